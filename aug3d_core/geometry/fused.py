"""Fused points of depth maps as plain arrays, and their file."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Float, UInt8

from aug3d_core.geometry.views import _Arrays


@dataclass(frozen=True)
class Fused(_Arrays):
    """Oriented, coloured points in the world frame."""

    xyz: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]  # unit, towards the cameras
    rgb: UInt8[np.ndarray, "n 3"]
    views: UInt8[np.ndarray, " n"]  # how many photos agreed

    def take(self, rows: Bool[np.ndarray, " n"]) -> Fused:
        """Return the chosen points."""
        return Fused(*(getattr(self, field.name)[rows] for field in fields(self)))
