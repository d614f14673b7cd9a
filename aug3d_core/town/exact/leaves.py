"""Leaves that look different in every photograph: wind moves them, and each hides others from elsewhere."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Float16, UInt8
from scipy.spatial import KDTree

from aug3d_core.geometry.transforms import apply, invert
from aug3d_core.geometry.views import Views
from aug3d_core.town.generator.noise import fractal

_NEAR = 4  # crowns that may hold a point
_FLAT = 1.6  # height of a crown in its widths, at most
_LUMPS_PX = (1, 2, 4)


def leaf_pixels(
    views: Views, view: int, depth: Float16[np.ndarray, "h w"], crowns: Float[np.ndarray, "n 4"]
) -> Bool[np.ndarray, "h w"]:
    """Tell which pixels of a view show a crown. depth: along the camera's z; crowns: middle and radius [m]."""
    leaves = np.zeros(depth.shape, bool)
    if not len(crowns):
        return leaves
    fx, fy, cx, cy = views.intrinsics[view]
    row, column = np.nonzero(depth > 0)
    z = depth[row, column].astype(float)
    in_cam = np.stack([(column + 0.5 - cx) / fx * z, (row + 0.5 - cy) / fy * z, z], axis=1)
    points = apply(invert(views.cam_from_world[view]), in_cam)
    found = KDTree(crowns[:, :2]).query(points[:, :2], k=min(_NEAR, len(crowns)))
    away_m, which = (each.reshape(len(points), -1) for each in found)
    radius_m = crowns[which, 3]
    above_m = np.abs(points[:, 2:] - crowns[which, 2])
    leaves[row, column] = ((away_m < 1.1 * radius_m) & (above_m < _FLAT * radius_m)).any(axis=1)
    return leaves


def rustle(
    rgb: UInt8[np.ndarray, "h w 3"], leaves: Bool[np.ndarray, "h w"], spread: float, rng: np.random.Generator
) -> UInt8[np.ndarray, "h w 3"]:
    """Return a picture whose leaves have light and shadow of their own. spread: of the logarithm of the light [1]."""
    light = np.exp(spread * fractal(leaves.shape, _LUMPS_PX, rng))
    moved = np.where(leaves[..., None], rgb * light[..., None], rgb)
    return np.rint(np.clip(moved, 0, 255)).astype(np.uint8)
