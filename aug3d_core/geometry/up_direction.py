"""Which way is up, and where is the ground, when only cameras and points are known."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

_TRIALS = 500
_MOST_POINTS = 20_000
_MOST_TILT_DEG = 60.0
_LEAST_INLIERS = 0.2
GROUND_PERCENTILE = 10.0


def up_from_cameras(cam_from_world: Float[np.ndarray, "n 3 4"]) -> Float[np.ndarray, " 3"]:
    """Guess the up direction from cameras held level or looking down: the mean of their up and backward axes.

    Level cameras' up axes and downward cameras' backward axes point up; what is horizontal cancels as headings vary.
    Good to some tens of degrees then; of one heading alone, or of cameras on their side, to no better than 45.
    """
    return _unit(-(cam_from_world[:, 1, :3] + cam_from_world[:, 2, :3]).sum(axis=0))


def fit_up(
    points_in_world: Float[np.ndarray, "p 3"],
    guess: Float[np.ndarray, " 3"],
    thickness: float,
    rng: np.random.Generator,
) -> Float[np.ndarray, " 3"]:
    """Return the unit normal of the plane that holds most points within +-`thickness`, on the guess's side.

    Only planes within 60 degrees of the guess, a unit vector, are tried; without a plane that holds a fifth of the points the
    guess itself is returned.
    """
    points = points_in_world
    if len(points) > _MOST_POINTS:
        points = points[rng.choice(len(points), _MOST_POINTS, replace=False)]
    best_up, best_inliers = guess, np.zeros(len(points), bool)
    for _ in range(_TRIALS):
        corner = points[rng.choice(len(points), 3, replace=False)]
        normal = np.cross(corner[1] - corner[0], corner[2] - corner[0])
        if not np.any(normal):
            continue
        normal = _unit(normal if normal @ guess > 0 else -normal)
        if normal @ guess < np.cos(np.radians(_MOST_TILT_DEG)):
            continue
        inliers = np.abs((points - corner[0]) @ normal) < thickness
        if inliers.sum() > best_inliers.sum():
            best_up, best_inliers = normal, inliers
    if best_inliers.mean() < _LEAST_INLIERS:
        return guess
    return _refine(points[best_inliers], best_up)


def rotation_to_z(up_in_world: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """Return the smallest rotation that turns the unit vector `up` to +z."""
    x, y, z = up_in_world
    if z < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    # Rodrigues' formula for the axis up x z, written out
    return np.array(
        [[1 - x * x / (1 + z), -x * y / (1 + z), -x], [-x * y / (1 + z), 1 - y * y / (1 + z), -y], [x, y, z]]
    )


def ground_height(heights: Float[np.ndarray, " p"]) -> float:
    """Return the ground's level: low among the points, but above the few stray ones that lie under it."""
    return float(np.percentile(heights, GROUND_PERCENTILE))


def _refine(points: Float[np.ndarray, "p 3"], up: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
    normal = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][2]
    return normal if normal @ up > 0 else -normal


def _unit(vector: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
    return vector / np.linalg.norm(vector)
