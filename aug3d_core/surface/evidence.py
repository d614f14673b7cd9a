"""Which fused points may make a surface: those that are not alone in the air."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import KDTree

from aug3d_core.geometry.fused import Fused
from aug3d_core.run.errors import InputError

MIN_POINTS = 1000  # below this a surface would be an invention
NEIGHBOURS = 8
OUTLIER_SIGMA = 3.0
SAMPLE = 50_000  # points whose neighbours tell the spacing


@dataclass(frozen=True)
class Evidence:
    """Oriented points in the world frame."""

    xyz: Float[np.ndarray, "p 3"]
    normals: Float[np.ndarray, "p 3"]  # unit, towards the cameras that see the point
    spacing: float  # median distance of a point to its nearest four, world units


def gather(fused: Fused) -> Evidence:
    """Return the points to draw a surface through; raises InputError if there are too few."""
    xyz, normals = fused.xyz.astype(np.float64), fused.normals.astype(np.float64)
    length = np.linalg.norm(normals, axis=1)
    sound = np.isfinite(xyz).all(axis=1) & (length > 0)
    xyz, normals = xyz[sound], normals[sound] / length[sound, None]
    if len(xyz) >= MIN_POINTS:
        inlier = _inliers(xyz)
        xyz, normals = xyz[inlier], normals[inlier]
    if len(xyz) < MIN_POINTS:
        raise InputError(
            f"only {len(xyz)} of {len(fused.xyz)} fused points can carry a surface, which takes {MIN_POINTS}",
            "take more photos of textured ground with at least 60 % overlap, or use larger working copies",
        )
    step = -(-len(xyz) // SAMPLE)
    distance = np.asarray(KDTree(xyz).query(xyz[::step], 5)[0])
    return Evidence(xyz, normals, float(np.median(distance[:, 1:])))


def _inliers(xyz: Float[np.ndarray, "p 3"]) -> Bool[np.ndarray, " p"]:
    """Tell which points are not unusually far from their neighbours (log distances, as density varies much)."""
    distance = np.asarray(KDTree(xyz).query(xyz, NEIGHBOURS + 1)[0])[:, 1:].mean(axis=1)
    score = np.log(np.maximum(distance, 1e-12))
    return score <= score.mean() + OUTLIER_SIGMA * score.std()
