"""Rigid transforms and projection. `b_from_a` maps a point in frame a to frame b; conventions as in `views.py`."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float


def homogeneous(transform: Float[np.ndarray, "*n 3 4"]) -> Float[np.ndarray, "*n 4 4"]:
    """Append the row (0, 0, 0, 1)."""
    row = np.broadcast_to(np.array([0.0, 0.0, 0.0, 1.0]), (*transform.shape[:-2], 1, 4))
    return np.concatenate([transform, row], axis=-2)


def invert(b_from_a: Float[np.ndarray, "*n 3 4"]) -> Float[np.ndarray, "*n 3 4"]:
    """Invert a rigid transform: (R, t) -> (R^T, -R^T t)."""
    rotation = np.swapaxes(b_from_a[..., :3], -1, -2)
    return np.concatenate([rotation, -rotation @ b_from_a[..., 3:]], axis=-1)


def apply(
    b_from_a: Float[np.ndarray, "*n 3 4"], points_in_a: Float[np.ndarray, "*n p 3"]
) -> Float[np.ndarray, "*n p 3"]:
    """Map points from frame a to frame b."""
    return points_in_a @ np.swapaxes(b_from_a[..., :3], -1, -2) + np.swapaxes(b_from_a[..., 3:], -1, -2)


def centres(cam_from_world: Float[np.ndarray, "*n 3 4"]) -> Float[np.ndarray, "*n 3"]:
    """Return camera centres in the world frame."""
    return invert(cam_from_world)[..., 3]


def forward(cam_from_world: Float[np.ndarray, "*n 3 4"]) -> Float[np.ndarray, "*n 3"]:
    """Return unit viewing directions in the world frame."""
    return cam_from_world[..., 2, :3]


def project(points_in_cam: Float[np.ndarray, "*n 3"], intrinsics: Float[np.ndarray, " 4"]) -> Float[np.ndarray, "*n 2"]:
    """Project points in front of the camera (z > 0) to pixels."""
    return points_in_cam[..., :2] / points_in_cam[..., 2:] * intrinsics[:2] + intrinsics[2:]


def look_at(
    centre_in_world: Float[np.ndarray, " 3"], target_in_world: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "3 4"]:
    """Return the `cam_from_world` of a camera that looks at a target with the horizon level.

    Looking straight down, the top of the image points north (+y).
    """
    z = target_in_world - centre_in_world
    z = z / np.linalg.norm(z)
    up = np.array([0.0, 0.0, 1.0]) if abs(z[2]) < 1 - 1e-9 else np.array([0.0, 1.0, 0.0])
    x = np.cross(z, up)
    x = x / np.linalg.norm(x)
    rotation = np.stack([x, np.cross(z, x), z])
    return np.concatenate([rotation, (-rotation @ centre_in_world)[:, None]], axis=1)
