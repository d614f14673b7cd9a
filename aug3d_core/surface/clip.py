"""Cut a mesh exactly at a plane across x or y: triangles that cross it are split, and new corners lie on it to the last bit."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from aug3d_core.geometry.ground_tiles import Tile
from aug3d_core.surface.shape import Shape, drop_degenerate


def clip_to(shape: Shape, tile: Tile) -> Shape:
    """Return what lies over a tile of ground."""
    for axis in (0, 1):
        for sign, at in ((1.0, tile.low[axis]), (-1.0, tile.high[axis])):
            if np.isfinite(at):
                shape = _clip(shape, axis, at, sign)
    return shape


def _clip(shape: Shape, axis: int, at: float, sign: float) -> Shape:
    """Return the part on one side of a plane, above it where `sign` is 1; a triangle within the plane is on no side."""
    beyond = sign * (shape.xyz[:, axis] - at)
    inside = beyond[shape.triangles] >= 0
    count = inside.sum(axis=1)
    crossing = np.flatnonzero((count > 0) & (count < 3))
    whole = shape.triangles[(count == 3) & (beyond[shape.triangles] > 0).any(axis=1)]
    if not len(crossing):
        return Shape(shape.xyz, whole).keep(np.ones(len(whole), bool))
    # Turn each so that its first corner is the one that is alone on its side
    alone = np.where(count[crossing] == 1, inside[crossing].argmax(axis=1), inside[crossing].argmin(axis=1))
    a, b, c = np.take_along_axis(shape.triangles[crossing], (alone[:, None] + np.arange(3)) % 3, axis=1).T
    xyz, middle = _with_crossings(shape, np.stack([np.concatenate([a, a]), np.concatenate([b, c])], 1), axis, at)
    ab, ac = middle.reshape(2, -1)
    tip = count[crossing] == 1
    parts = [
        whole,
        np.stack([a, ab, ac], 1)[tip],
        np.stack([ab, b, c], 1)[~tip],
        np.stack([ab, c, ac], 1)[~tip],
    ]
    return drop_degenerate(Shape(xyz, np.concatenate(parts).astype(np.int32)))


def _with_crossings(
    shape: Shape, pairs: Int[np.ndarray, "e 2"], axis: int, at: float
) -> tuple[np.ndarray, Int[np.ndarray, " e"]]:
    """Return all corners with those on the plane added, one for each edge, and for each pair the index of its own.

    An edge that ends on the plane has no new corner: its end is the one.
    """
    edge, own = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)
    first, last = shape.xyz[edge[:, 0]], shape.xyz[edge[:, 1]]
    along = (at - first[:, axis]) / (last[:, axis] - first[:, axis])
    on_plane = first + along[:, None] * (last - first)
    on_plane[:, axis] = at
    corner = np.where(along == 0, edge[:, 0], np.where(along == 1, edge[:, 1], len(shape.xyz) + np.arange(len(edge))))
    return np.concatenate([shape.xyz, on_plane]), corner[own.ravel()]
