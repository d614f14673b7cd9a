"""How long each run is trained: the same in every arm, and shorter than for a single good model."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from aug3d_core.studies.paper.scene import FinishedScene

_SHARE, _QUICK_SHARE = 1 / 4, 1 / 60  # of the preset's steps
# No arm stops early, and no pictures are drawn: nobody looks at the many models of a study.
_ALIKE = ("training.least_gain_db=0", "evaluation.panels=0", "evaluation.flythrough_frames=0")


def study_effort(scene: FinishedScene, quick: bool, overrides: Iterable[str]) -> FinishedScene:
    """Return the scene with the training steps of a study, and with the user's settings."""
    training = scene.settings.training
    share = _QUICK_SHARE if quick else _SHARE
    shortened = [
        f"training.{name}={max(1, round(share * getattr(training, name)))}" for name in ("steps", "warmup_steps")
    ]
    return replace(scene, settings=scene.config((*shortened, *_ALIKE, *overrides)))


def repeats(seeds: int, quick: bool) -> int:
    """Return the number of seeds: at most two for a quick study, since an interval needs two."""
    return min(seeds, 2) if quick else seeds
