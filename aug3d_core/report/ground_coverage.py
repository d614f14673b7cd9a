"""How many photographs see each piece of the ground, and which pieces the flight encloses."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import distance_transform_edt
from scipy.spatial import Delaunay, QhullError

from aug3d_core.geometry.transforms import apply, centres, forward, project
from aug3d_core.geometry.views import Views
from aug3d_core.report.top_view import Frame

_LONGEST_PX, _SHORTEST_PX = 160, 40  # longer side of the map of overlap
_MOST_LOOKS = 10_000_000  # cells times views
_FAR = 3.0  # heights of the flight: who looks farther looks at no ground


def overlap_frame(frame: Frame, views: int) -> Frame:
    """Return the frame of a map of overlap: coarser where there are many views, so that it takes a second."""
    least = frame.scaled(_SHORTEST_PX)
    finer = np.sqrt(_MOST_LOOKS / max(views * least.size[0] * least.size[1], 1))
    return frame.scaled(int(np.clip(_SHORTEST_PX * finer, _SHORTEST_PX, _LONGEST_PX)))


def seen_by(heights: Float[np.ndarray, "h w"], frame: Frame, views: Views) -> Int[np.ndarray, "h w"]:
    """Return how many photographs hold each piece of ground in their frame, -1 where its height is not known (NaN)."""
    known = np.isfinite(heights)
    seen = np.full(heights.shape, -1)
    seen[known] = _in_frames(np.column_stack([_middles(known, frame), heights[known]]), views)
    return seen


def enclosed(heights: Float[np.ndarray, "h w"], frame: Frame, views: Views) -> Bool[np.ndarray, "h w"]:
    """Tell which pieces a flight encloses: the hull of where its cameras look, and a quarter of a picture about it.

    Beyond, photographs thin out on every flight. heights: of the ground, NaN where unknown; what is looked at is level.
    """
    eyes, looks = centres(views.cam_from_world), forward(views.cam_from_world)
    up = eyes[:, 2] - np.nanmedian(heights)
    height = float(np.median(up))
    away = up / np.where(looks[:, 2] < 0, -looks[:, 2], np.nan)
    meets = (away > 0) & (away < _FAR * height)
    aims = (eyes + away[:, None] * looks)[meets, :2]
    inside = np.zeros(heights.shape, bool)
    column, row = np.floor(frame.place(aims)).astype(int).T
    there = (row >= 0) & (row < inside.shape[0]) & (column >= 0) & (column < inside.shape[1])
    inside[row[there], column[there]] = True
    if not inside.any():
        return inside
    with suppress(QhullError):  # all in a line: they enclose nothing
        inside |= (Delaunay(aims).find_simplex(_middles(np.ones_like(inside), frame)) >= 0).reshape(inside.shape)
    picture = height * float(np.median(views.size.min(axis=1) / views.intrinsics[:, 0]))
    return np.asarray(distance_transform_edt(~inside)) <= picture / 4 * frame.px


def _middles(cells: Bool[np.ndarray, "h w"], frame: Frame) -> Float[np.ndarray, "p 2"]:
    """Return the middles of pieces of the ground, row by row, in the world."""
    row, column = np.nonzero(cells)
    return frame.low + np.stack([column + 0.5, frame.size[1] - row - 0.5], axis=1) / frame.px


def _in_frames(places: Float[np.ndarray, "p 3"], views: Views) -> Int[np.ndarray, " p"]:
    """Return in how many views each place falls."""
    count = np.zeros(len(places), int)
    for cam_from_world, intrinsics, size in zip(views.cam_from_world, views.intrinsics, views.size, strict=True):
        in_cam = apply(cam_from_world, places)
        ahead = np.flatnonzero(in_cam[:, 2] > 0)
        xy = project(in_cam[ahead], intrinsics)
        count[ahead[((xy >= 0) & (xy < size)).all(axis=1)]] += 1
    return count
