"""Which points may make a surface: seen by enough of the allowed photos, well placed, and not alone in the air."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import KDTree

from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.surface.config import SurfaceConfig

MIN_VIEWS = 2
MIN_POINTS = 100  # below this a surface would be an invention


@dataclass(frozen=True)
class Evidence:
    """Oriented points in the world frame."""

    xyz: Float[np.ndarray, "p 3"]
    normals: Float[np.ndarray, "p 3"]  # unit, towards the cameras that see the point
    spacing: float  # median distance of a point to its nearest few, world units


def gather(
    points: Points, tracks: Tracks, views: Views, allowed: Bool[np.ndarray, " n"], config: SurfaceConfig
) -> Evidence | None:
    """Return the oriented points that the allowed views alone support, or None if there are too few."""
    towards, angle_deg, seen = _rays(points, tracks, views, allowed)
    good = (seen >= MIN_VIEWS) & (points.error_px <= config.max_error_px) & (angle_deg >= config.min_angle_deg)
    xyz, towards = points.xyz[good], towards[good]
    if len(xyz) < MIN_POINTS:
        return None
    inlier = _inliers(xyz, config.neighbours, config.outlier_sigma)
    xyz, towards = xyz[inlier], towards[inlier]
    if len(xyz) < MIN_POINTS:
        return None
    distance, index = map(np.asarray, KDTree(xyz).query(xyz, config.neighbours + 1))
    normals = _normals(xyz, index)
    normals *= np.where(np.einsum("pi,pi->p", normals, towards) < 0, -1.0, 1.0)[:, None]
    return Evidence(xyz, normals, float(np.median(distance[:, 1:5])))


def _rays(
    points: Points, tracks: Tracks, views: Views, allowed: Bool[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, "p 3"], Float[np.ndarray, " p"], Int[np.ndarray, " p"]]:
    """Return per point: mean unit direction to its cameras, angle that its rays span (degrees), number of rays."""
    use = allowed[tracks.view]
    point, view = tracks.point[use], tracks.view[use]
    ray = centres(views.cam_from_world)[view] - points.xyz[point]
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    count = len(points.xyz)
    mean = np.stack([np.bincount(point, ray[:, axis], minlength=count) for axis in range(3)], axis=1)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-30)
    cosine = np.ones(count)
    np.minimum.at(cosine, point, np.einsum("ti,ti->t", ray, mean[point]))
    return mean, 2 * np.degrees(np.arccos(cosine.clip(-1, 1))), np.bincount(point, minlength=count)


def _inliers(xyz: Float[np.ndarray, "p 3"], neighbours: int, sigma: float) -> Bool[np.ndarray, " p"]:
    """Tell which points are not unusually far from their neighbours (log distances, as density varies much)."""
    distance = KDTree(xyz).query(xyz, min(neighbours, len(xyz) - 1) + 1)[0][:, 1:].mean(axis=1)
    score = np.log(np.maximum(distance, 1e-12))
    return score <= score.mean() + sigma * score.std()


def _normals(xyz: Float[np.ndarray, "p 3"], index: Int[np.ndarray, "p k"]) -> Float[np.ndarray, "p 3"]:
    """Return the direction in which each neighbourhood is thinnest; the sign is arbitrary."""
    near = xyz[index]
    near = near - near.mean(axis=1, keepdims=True)
    return np.linalg.eigh(np.einsum("pki,pkj->pij", near, near))[1][:, :, 0]
