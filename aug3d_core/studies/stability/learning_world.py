"""What cells that train add to the small town: views of a few pixels and networks that learn in seconds.

It beats the mean colour of its input views by some dB; cells ask whether it still does.
"""

from __future__ import annotations

from collections.abc import Mapping

from aug3d_core.studies.stability.world import SMALL_TOWN

_SIZE = {"width_px": 96, "height_px": 72}
_LEARNING: Mapping[str, Mapping[str, object]] = {
    "town": {"seed": 0},  # the first seed of cells that build towns: one town less to render
    # So small a town cannot keep a real one's gap about its test; what cells ask is how far a model is from itself
    "grouping": {"gap_shared_share": 0.6},
    "sampling": {**_SIZE, "domes": 6},
    "dataset": _SIZE,
    "training": {
        "head.planes": 16,
        "head.crop_px": 64,
        "steps": 200,
        "learning_rate": 1e-3,
        "warmup_steps": 30,
        "least_gain_db": 0,
    },
    "evaluation": {"panels": 2, "flythrough_frames": 0},
}
# Nine input views need as many photographs of the block that is tested: forty in all, and one fold
_MANY: Mapping[str, Mapping[str, object]] = {
    "town": {"length_m": 110, "width_m": 90, "forward_overlap": 0.82, "side_overlap": 0.75},
    "grouping": {"k": 10, "folds": 1, "test_share": 0.4},
}


def _words(settings: Mapping[str, Mapping[str, object]]) -> tuple[str, ...]:
    return tuple(f"{stage}.{name}={value}" for stage, fields in settings.items() for name, value in fields.items())


_PAPERS = {
    "head": "pixelnerf",
    "head.hidden": 32,
    "head.encoder_channels": 12,
    "head.rays_per_group": 256,
    "steps": 200,
    "warmup_steps": 30,
    "least_gain_db": 0,
}

PIXELNERF = _words({"training": _PAPERS})  # a method: the paper's model in place of the plane sweep
LEARNING_TOWN = (*SMALL_TOWN, *_words(_LEARNING))
MANY_PHOTOS = (*LEARNING_TOWN, *_words(_MANY))
