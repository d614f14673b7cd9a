"""The table of planned cameras, and its file. Conventions as in `geometry/views.py`, but `world_from_cam` as 4x4."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.domes.boxes import Buildings


@dataclass(frozen=True)
class Cameras:
    """Virtual pinhole cameras; those of one dome follow each other, and every dome has equally many."""

    view_id: Int[np.ndarray, " m"]
    dome_id: Int[np.ndarray, " m"]
    world_from_cam: Float[np.ndarray, "m 4 4"]
    intrinsics: Float[np.ndarray, "m 4"]  # fx, fy, cx, cy in px
    size: Int[np.ndarray, "m 2"]  # width, height in px

    def __len__(self) -> int:
        return len(self.view_id)

    def save(self, path: Path) -> None:
        """Write the arrays; the bytes depend on the arrays alone."""
        with path.open("wb") as file:
            np.savez(file, **{f.name: getattr(self, f.name) for f in fields(self)})

    @classmethod
    def load(cls, path: Path) -> Cameras:
        """Read what `save` wrote."""
        with np.load(path, allow_pickle=False) as arrays:
            return cls(**{f.name: arrays[f.name] for f in fields(cls)})


@dataclass(frozen=True)
class Dome:
    """One place that cameras look at, or that was passed over; `why` says which and for what reason."""

    x: float
    y: float
    z: float
    radius: float  # world units; of the nearest cameras allowed
    cell: float  # its scale: the side of the square that it stands on, world units
    views: int  # 0 where it was passed over
    why: str
    tried: int = 0  # cameras drawn
    rejected: Mapping[str, int] = field(default_factory=dict)  # of those, by reason


@dataclass(frozen=True)
class Plan:
    """What a sampler answers with. `cameras.dome_id` counts the domes that have views, in the order of `domes`."""

    cameras: Cameras
    domes: tuple[Dome, ...]
    buildings: Buildings | None = None  # that they were placed over
    notes: tuple[str, ...] = ()  # what the user should know, where the method could not do what it is for
