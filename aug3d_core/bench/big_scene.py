"""A large flight without its pictures: poses, points and tracks as they come of thousands of photographs over flat ground.

A lawnmower flight with 80 % forward and 70 % side overlap: each place on the ground is inside 4 or 5 photographs of a line
and of 3 or 4 lines. A point is matched in some of those only; track lengths are 2 and more, falling geometrically, 5 in the
mean, as aerial blocks have them.
"""

from __future__ import annotations

import numpy as np

from aug3d_core.geometry.views import Points, Tracks, Views

_ALTITUDE_M = 100.0
_FOCAL_PX, _WIDTH_PX, _HEIGHT_PX = 1000.0, 1200, 800
_ALONG, _ACROSS = 5, 3  # photographs of a line, and lines, whose frames hold a place on the ground
_MEAN_TRACK, _MEAN_CUT = 5.0, 4.8  # before and after tracks are cut at 15, and at the edge of the flight
_STEPS = np.array([1, 2, 4, 7, 8, 11, 13, 14])  # coprime to the 15 photographs that may see a point


def big_scene(photos: int, observations: int) -> tuple[Views, Points, Tracks]:
    """Return a flight of about `photos` photographs in a square of lines, with about so many observations."""
    rng = np.random.default_rng(0)
    forward_m = _HEIGHT_PX / _FOCAL_PX * _ALTITUDE_M / _ALONG
    side_m = _WIDTH_PX / _FOCAL_PX * _ALTITUDE_M / _ACROSS
    lines = max(1, round(np.sqrt(photos * forward_m / side_m)))
    per_line = max(2, round(photos / lines))
    views = _flight(lines, per_line, side_m, forward_m)
    count = max(1, round(observations / _MEAN_CUT))
    size = np.array([lines * side_m, per_line * forward_m])
    xyz = np.column_stack([rng.uniform(0, size, (count, 2)), rng.normal(0, 0.5, count)])
    line, place = (xyz[:, :2] / [side_m, forward_m]).astype(int).T
    length = np.minimum(1 + rng.geometric(1 / (_MEAN_TRACK - 1), count), _ALONG * _ACROSS)
    point = np.repeat(np.arange(count), length)
    turn = np.arange(len(point)) - np.repeat(np.cumsum(length) - length, length)
    first, step = rng.integers(0, _ALONG * _ACROSS, count), rng.choice(_STEPS, count)
    which = (first[point] + turn * step[point]) % (_ALONG * _ACROSS)
    at = line[point] + which // _ALONG - _ACROSS // 2, place[point] + which % _ALONG - _ALONG // 2
    inside = (at[0] >= 0) & (at[0] < lines) & (at[1] >= 0) & (at[1] < per_line)
    view = _number(at[0], at[1], per_line)[inside]
    tracks = Tracks(point[inside], view, np.zeros((len(view), 2)))
    return views, Points(xyz, np.zeros((count, 3), np.uint8), np.zeros(count)), tracks


def _number(line: np.ndarray, place: np.ndarray, per_line: int) -> np.ndarray:
    """Return the capture order: every second line is flown back."""
    return line * per_line + np.where(line % 2, per_line - 1 - place, place)


def _flight(lines: int, per_line: int, side_m: float, forward_m: float) -> Views:
    line, place = (axis.ravel() for axis in np.indices((lines, per_line)))
    order = np.argsort(_number(line, place, per_line))
    line, place = line[order], place[order]
    at = np.column_stack([(line + 0.5) * side_m, (place + 0.5) * forward_m, np.full(len(line), _ALTITUDE_M)])
    along = np.where(line % 2, -1.0, 1.0)
    rotation = np.zeros((len(line), 3, 3))  # looking straight down, the top of the image along the line
    rotation[:, 0, 0], rotation[:, 1, 1], rotation[:, 2, 2] = along, -along, -1.0
    poses = np.concatenate([rotation, -(rotation @ at[:, :, None])], axis=2)
    intrinsics = np.tile([_FOCAL_PX, _FOCAL_PX, _WIDTH_PX / 2, _HEIGHT_PX / 2], (len(line), 1))
    return Views(np.arange(len(line)), poses, intrinsics, np.tile([_WIDTH_PX, _HEIGHT_PX], (len(line), 1)))
