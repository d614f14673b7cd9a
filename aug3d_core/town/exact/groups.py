"""Groups of views that show the same surface, counted on their exact depth."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Float16, Int

from aug3d_core.geometry.transforms import apply, invert, project
from aug3d_core.geometry.views import Views

NET = (12, 9)  # points of a view, across and down
_HIDDEN = 0.02  # share of the way by which a point lies behind what a view shows there, where it is hidden


def net_points(views: Views, depth: Float16[np.ndarray, "n h w"]) -> list[Float[np.ndarray, "_ 3"]]:
    """Return the points that a net of pixels of each view shows, in the world."""
    height, width = depth.shape[1:]
    columns = ((np.arange(NET[0]) + 0.5) * width / NET[0]).astype(int)
    rows = ((np.arange(NET[1]) + 0.5) * height / NET[1]).astype(int)
    x, y = (axis.ravel() for axis in np.meshgrid(columns, rows))
    found = []
    for view in range(len(views)):
        z = depth[view, y, x].astype(float)
        fx, fy, cx, cy = views.intrinsics[view]
        in_cam = np.stack([(x + 0.5 - cx) / fx * z, (y + 0.5 - cy) / fy * z, z], axis=1)[z > 0]
        found.append(apply(invert(views.cam_from_world[view]), in_cam))
    return found


def shared(views: Views, depth: Float16[np.ndarray, "n h w"]) -> Float[np.ndarray, "n n"]:
    """Return the share of each view's net that each other view shows too, nothing in between; the mean of both ways."""
    n, (height, width) = len(views), depth.shape[1:]
    share = np.zeros((n, n))
    for one, points in enumerate(net_points(views, depth)):
        for other in range(n):
            in_cam = apply(views.cam_from_world[other], points)
            xy = project(in_cam[in_cam[:, 2] > 1e-6], views.intrinsics[other])
            z = in_cam[in_cam[:, 2] > 1e-6, 2]
            inside = ((xy >= 0) & (xy < [width, height])).all(axis=1)
            x, y = xy[inside].astype(int).T
            met = depth[other, y, x].astype(float)
            share[one, other] = np.sum(z[inside] <= met * (1 + _HIDDEN)) / (NET[0] * NET[1])
    return (share + share.T) / 2


def grouped(views: Views, depth: Float16[np.ndarray, "n h w"], k: int) -> Int[np.ndarray, "n k"]:
    """Return a group about each view: itself, and the k - 1 that share most with it."""
    share = shared(views, depth)
    np.fill_diagonal(share, 2.0)
    return np.argsort(-share, axis=1, kind="stable")[:, :k].astype(np.int32)
