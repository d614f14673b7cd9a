"""Join two meshes that end at one plane: their rims there become one line, corner for corner.

Both were drawn through the same points near the plane, so their rims are nearly the same curve, but not to the last bit. The
rim of the mesh above is laid on the rim of the mesh below, and each gets the corners of the other: between the two there is
neither a gap nor an overlap. Where the rims are further apart than `reach`, the two surfaces differ, and are left as they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import KDTree

from aug3d_core.surface.shape import Shape
from aug3d_core.surface.tiles import Halved

SAMPLES = 4  # to a reach, on the rim: finds the piece of it that is nearest
WELD = 0.05  # of the reach: corners that are nearer become one, or slivers would stand between them


@dataclass(frozen=True)
class _Rim:
    """Edges in the plane that one triangle alone has: from `corner` of `triangle` to its next."""

    triangle: Int[np.ndarray, " s"]
    corner: Int[np.ndarray, " s"]
    ends: Int[np.ndarray, "s 2"]

    @property
    def vertices(self) -> Int[np.ndarray, " v"]:
        return np.unique(self.ends)


@dataclass(frozen=True)
class _Nearest:
    """For each of some places, the nearest place of a rim."""

    edge: Int[np.ndarray, " p"]
    along: Float[np.ndarray, " p"]  # 0 to 1 from the edge's first end to its second
    xyz: Float[np.ndarray, "p 3"]
    off: Float[np.ndarray, " p"]  # world units


def join(below: Shape, above: Shape, border: Halved, reach: float) -> Shape:
    """Return both as one mesh; `reach` (world units) is how far rims may be apart and still be one line."""
    low, high = _rim(below, border), _rim(above, border)
    if len(low.ends) and len(high.ends):
        corners = low.vertices
        laid = _lay(below, low, above.xyz[high.vertices], border, reach)
        moved = above.xyz.copy()
        moved[high.vertices[laid.near]] = laid.xyz[laid.near]
        above = Shape(moved, above.triangles)
        new = laid.near & ~laid.at_corner
        below = _insert(below, low, laid.edge[new], laid.along[new], laid.xyz[new])
        own = _nearest(above, high, below.xyz[corners], border, reach)
        new = (own.off <= reach) & (own.along > 0) & (own.along < 1)
        above = _insert(above, high, own.edge[new], own.along[new], below.xyz[corners[new]])
    both = Shape(
        np.concatenate([below.xyz, above.xyz]),
        np.concatenate([below.triangles, above.triangles + len(below.xyz)]).astype(np.int32),
    )
    return _welded(both, both.xyz[:, border.axis] == border.at)


def rim_edges(shape: Shape, border: Halved) -> Int[np.ndarray, "s 2"]:
    """Return the edges on a border that one triangle alone has: where a joined mesh is still open."""
    return _rim(shape, border).ends


@dataclass(frozen=True)
class _Laid:
    """Where on a rim each of some corners comes to lie."""

    xyz: Float[np.ndarray, "p 3"]
    edge: Int[np.ndarray, " p"]
    along: Float[np.ndarray, " p"]
    at_corner: Bool[np.ndarray, " p"]  # of the rim; else between two
    near: Bool[np.ndarray, " p"]  # enough to be moved there


def _lay(below: Shape, rim: _Rim, xyz: Float[np.ndarray, "p 3"], border: Halved, reach: float) -> _Laid:
    near = _nearest(below, rim, xyz, border, reach)
    first, last = below.xyz[rim.ends[near.edge, 0]], below.xyz[rim.ends[near.edge, 1]]
    length = np.linalg.norm(last - first, axis=1)
    at_first, at_last = near.along * length <= WELD * reach, (1 - near.along) * length <= WELD * reach
    place = np.where(at_first[:, None], first, np.where(at_last[:, None], last, near.xyz))
    at_corner, off = at_first | at_last, near.off
    # Where another border crosses, corners keep to it: it is joined later, and would not find them elsewhere
    u = 1 - border.axis
    for side in (border.ground.low[u], border.ground.high[u]):
        mine = np.flatnonzero(xyz[:, u] == side)
        theirs = below.xyz[rim.vertices[below.xyz[rim.vertices, u] == side]]
        at_corner[mine], off[mine] = True, np.inf
        if len(mine) and len(theirs):
            apart = np.abs(xyz[mine, None, 2] - theirs[None, :, 2])
            place[mine], off[mine] = theirs[apart.argmin(axis=1)], apart.min(axis=1)
    return _Laid(place, near.edge, near.along, at_corner, off <= reach)


def _rim(shape: Shape, border: Halved) -> _Rim:
    on = (shape.xyz[:, border.axis] == border.at)[shape.triangles]
    triangle, corner = np.nonzero(on & np.roll(on, -1, axis=1))
    ends = np.stack([shape.triangles[triangle, corner], shape.triangles[triangle, (corner + 1) % 3]], axis=1)
    _, own, count = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True, return_counts=True)
    open_ = count[own.ravel()] == 1
    return _Rim(triangle[open_], corner[open_], ends[open_])


def _nearest(shape: Shape, rim: _Rim, xyz: Float[np.ndarray, "p 3"], border: Halved, reach: float) -> _Nearest:
    """Find for places of the plane the nearest of a rim: the edge by samples along all, then the exact place on it."""
    first, last = shape.xyz[rim.ends[:, 0]], shape.xyz[rim.ends[:, 1]]
    count = 2 + (np.linalg.norm(last - first, axis=1) * SAMPLES / reach).astype(int)
    edge = np.repeat(np.arange(len(count)), count)
    number = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    part = (number / (count[edge] - 1))[:, None]
    tree = KDTree(first[edge] + part * (last - first)[edge])
    edge = edge[np.asarray(tree.query(xyz)[1])]
    way = (last - first)[edge]
    along = np.einsum("px,px->p", xyz - first[edge], way) / np.maximum(np.einsum("px,px->p", way, way), 1e-300)
    along = along.clip(0, 1)
    place = first[edge] + along[:, None] * way
    place[:, border.axis] = border.at
    return _Nearest(edge, along, place, np.linalg.norm(xyz - place, axis=1))


def _insert(
    shape: Shape, rim: _Rim, edge: Int[np.ndarray, " n"], along: Float[np.ndarray, " n"], xyz: Float[np.ndarray, "n 3"]
) -> Shape:
    """Return the mesh with more corners in edges of its rim: the triangle at each becomes a fan about the corner opposite."""
    order = np.lexsort((along, edge))
    edge, new = edge[order], len(shape.xyz) + np.arange(len(order))
    starts, ends = np.r_[True, edge[1:] != edge[:-1]][: len(edge)], np.r_[edge[1:] != edge[:-1], True][: len(edge)]
    tip = shape.triangles[rim.triangle, (rim.corner + 2) % 3]
    before = np.where(starts, rim.ends[edge, 0], np.roll(new, 1))
    fans = [np.stack([before, new, tip[edge]], 1), np.stack([new, rim.ends[edge, 1], tip[edge]], 1)[ends]]
    kept = np.ones(len(shape.triangles), bool)
    kept[rim.triangle[edge]] = False
    triangles = np.concatenate([shape.triangles[kept], *fans]).astype(np.int32)
    return Shape(np.concatenate([shape.xyz, xyz[order]]), triangles)


def _welded(shape: Shape, some: Bool[np.ndarray, " v"]) -> Shape:
    """Make one corner of those of `some` that are at one place; triangles that this leaves without a side go."""
    chosen = np.flatnonzero(some)
    _, first, own = np.unique(shape.xyz[chosen], axis=0, return_index=True, return_inverse=True)
    corner = np.arange(len(shape.xyz))
    corner[chosen] = chosen[first[own.ravel()]]
    a, b, c = corner[shape.triangles].T
    return Shape(shape.xyz, np.stack([a, b, c], 1).astype(np.int32)).keep((a != b) & (b != c) & (c != a))
