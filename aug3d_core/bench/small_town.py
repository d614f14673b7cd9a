"""The smallest town that structure from motion still puts together, and a network that learns next to nothing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

SETTINGS: dict[str, dict[str, Any]] = {
    "town": {"length_m": 75, "width_m": 80, "altitude_m": 45, "width_px": 320, "samples": 1, "photos_per_shard": 8},
    "matching": {"max_features": 2048},
    "grouping": {"k": 4, "groups": 8, "folds": 1},
    "depth": {"max_px": 192},
    "surface": {"texel_gsd": 3},
    "sampling": {"domes": 2, "width_px": 96, "height_px": 72},
    "rendering": {"views_per_shard": 4, "samples": 4},
    "dataset": {"width_px": 96, "height_px": 72},
    "training": {
        "steps": 30,
        "checkpoint_every": 10,
        "head": {"planes": 8, "features": 8, "crop_px": 64, "start": "random"},
    },
    "evaluation": {"flythrough_frames": 4},
}


def _flat(settings: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, value in settings.items():
        if isinstance(value, Mapping):
            yield from ((f"{name}.{inner}", one) for inner, one in _flat(value))
        else:
            yield name, value


OVERRIDES = [word for name, value in _flat(SETTINGS) for word in ("--set", f"{name}={value}")]
