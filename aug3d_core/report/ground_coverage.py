"""How many photographs see each piece of the ground."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.geometry.transforms import apply, project
from aug3d_core.geometry.views import Views
from aug3d_core.report.top_view import Frame

_LONGEST_PX, _SHORTEST_PX = 160, 40  # longer side of the map of overlap
_MOST_LOOKS = 10_000_000  # cells times views


def overlap_frame(frame: Frame, views: int) -> Frame:
    """Return the frame of a map of overlap: coarser where there are many views, so that it takes a second."""
    least = frame.scaled(_SHORTEST_PX)
    finer = np.sqrt(_MOST_LOOKS / max(views * least.size[0] * least.size[1], 1))
    return frame.scaled(int(np.clip(_SHORTEST_PX * finer, _SHORTEST_PX, _LONGEST_PX)))


def seen_by(heights: Float[np.ndarray, "h w"], frame: Frame, views: Views) -> Int[np.ndarray, "h w"]:
    """Return how many photographs hold each piece of ground in their frame, -1 where its height is not known (NaN)."""
    row, column = np.nonzero(np.isfinite(heights))
    east_north = frame.low + np.stack([column + 0.5, frame.size[1] - row - 0.5], axis=1) / frame.px
    seen = np.full(heights.shape, -1)
    seen[row, column] = _in_frames(np.column_stack([east_north, heights[row, column]]), views)
    return seen


def _in_frames(places: Float[np.ndarray, "p 3"], views: Views) -> Int[np.ndarray, " p"]:
    """Return in how many views each place falls."""
    count = np.zeros(len(places), int)
    for cam_from_world, intrinsics, size in zip(views.cam_from_world, views.intrinsics, views.size, strict=True):
        in_cam = apply(cam_from_world, places)
        ahead = np.flatnonzero(in_cam[:, 2] > 0)
        xy = project(in_cam[ahead], intrinsics)
        count[ahead[((xy >= 0) & (xy < size)).all(axis=1)]] += 1
    return count
