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

from aug3d_core.geometry.ground_tiles import Halved
from aug3d_core.surface.shape import Shape

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
class _Laid:
    """Where each of some corners comes to lie on a rim."""

    xyz: Float[np.ndarray, "p 3"]
    edge: Int[np.ndarray, " p"]
    along: Float[np.ndarray, " p"]  # 0 to 1 from the edge's first end to its second
    corner: Int[np.ndarray, " p"]  # of the rim, where it comes to lie on one; else -1
    near: Bool[np.ndarray, " p"]  # enough to be moved there


def join(below: Shape, above: Shape, border: Halved, reach: float) -> Shape:
    """Return both as one mesh; `reach` (world units) is how far rims may be apart and still be one line."""
    low, high = _rim(below, border), _rim(above, border)
    if len(low.ends) and len(high.ends):
        laid = _lay(below, low, above.xyz[high.vertices], border, reach)
        moved = above.xyz.copy()
        moved[high.vertices[laid.near]] = laid.xyz[laid.near]
        new = laid.near & (laid.corner < 0)
        partner = np.full(len(above.xyz), -1)  # of each corner above, the one below
        partner[high.vertices[laid.near]] = laid.corner[laid.near]
        partner[high.vertices[new]] = len(below.xyz) + np.arange(new.sum())
        below = _insert(below, low, laid.edge[new], laid.along[new], laid.xyz[new])
        edge, number, corner = _between(below.xyz, _rim(below, border).ends, partner[high.ends], reach)
        above = _insert(Shape(moved, above.triangles), high, edge, number, below.xyz[corner])
    both = Shape(
        np.concatenate([below.xyz, above.xyz]),
        np.concatenate([below.triangles, above.triangles + len(below.xyz)]).astype(np.int32),
    )
    return _welded(both, both.xyz[:, border.axis] == border.at)


def rim_edges(shape: Shape, border: Halved) -> Int[np.ndarray, "s 2"]:
    """Return the edges on a border that one triangle alone has: where a joined mesh is still open."""
    return _rim(shape, border).ends


def _lay(below: Shape, rim: _Rim, xyz: Float[np.ndarray, "p 3"], border: Halved, reach: float) -> _Laid:
    """Find for places of the plane the nearest of a rim."""
    edge, along, place = _nearest(below.xyz[rim.ends], xyz, reach)
    place[:, border.axis] = border.at
    off = np.linalg.norm(xyz - place, axis=1)
    length = np.linalg.norm(np.diff(below.xyz[rim.ends[edge]], axis=1)[:, 0], axis=1)
    corner = np.full(len(xyz), -1)
    for end, way in ((0, along), (1, 1 - along)):
        corner = np.where(way * length <= WELD * reach, rim.ends[edge, end], corner)
    # Where another border crosses, corners keep to it: it is joined later, and would not find them elsewhere
    u = 1 - border.axis
    for side in (border.ground.low[u], border.ground.high[u]):
        mine, theirs = np.flatnonzero(xyz[:, u] == side), rim.vertices[below.xyz[rim.vertices, u] == side]
        off[mine] = np.inf
        if len(mine) and len(theirs):
            apart = np.abs(xyz[mine, None, 2] - below.xyz[theirs, 2])
            corner[mine], off[mine] = theirs[apart.argmin(axis=1)], apart.min(axis=1)
    return _Laid(np.where(corner[:, None] < 0, place, below.xyz[corner]), edge, along, corner, off <= reach)


def _between(
    xyz: Float[np.ndarray, "v 3"], rim: Int[np.ndarray, "s 2"], pairs: Int[np.ndarray, "e 2"], reach: float
) -> tuple[Int[np.ndarray, " n"], Float[np.ndarray, " n"], Int[np.ndarray, " n"]]:
    """Return the corners that a rim has on the way between those of each pair: number of the pair, place in line, corner.

    A way that is longer than twice the straight one, and a reach, is another surface's.
    """
    neighbours: dict[int, list[int]] = {}
    for a, b in rim.tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    found = []
    for pair, (a, b) in enumerate(pairs.tolist()):
        if a < 0 or b < 0 or a == b or a not in neighbours or b not in neighbours:
            continue
        longest = float(2 * np.linalg.norm(xyz[b] - xyz[a]) + reach)
        ways = (_way(xyz, neighbours, a, first, b, longest) for first in neighbours[a])
        found += [(pair, place, corner) for place, corner in enumerate(next(filter(None, ways), [b])[:-1])]
    table = np.array(found, int).reshape(-1, 3)
    return table[:, 0], table[:, 1].astype(float), table[:, 2]


def _way(
    xyz: Float[np.ndarray, "v 3"], neighbours: dict[int, list[int]], start: int, first: int, end: int, longest: float
) -> list[int]:
    """Follow a line of corners from `start` by `first` to `end`; nothing if it does not lead there, or not so soon."""
    way, before = [first], start
    length = float(np.linalg.norm(xyz[first] - xyz[start]))
    while way[-1] != end and length <= longest:
        onward = [corner for corner in neighbours[way[-1]] if corner != before]
        if len(onward) != 1:
            return []
        before = way[-1]
        way.append(onward[0])
        length += float(np.linalg.norm(xyz[way[-1]] - xyz[before]))
    return way if length <= longest else []


def _rim(shape: Shape, border: Halved) -> _Rim:
    on = (shape.xyz[:, border.axis] == border.at)[shape.triangles]
    triangle, corner = np.nonzero(on & np.roll(on, -1, axis=1))
    ends = np.stack([shape.triangles[triangle, corner], shape.triangles[triangle, (corner + 1) % 3]], axis=1)
    _, own, count = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True, return_counts=True)
    open_ = count[own.ravel()] == 1
    return _Rim(triangle[open_], corner[open_], ends[open_])


def _nearest(
    ends: Float[np.ndarray, "s 2 3"], xyz: Float[np.ndarray, "p 3"], reach: float
) -> tuple[Int[np.ndarray, " p"], Float[np.ndarray, " p"], Float[np.ndarray, "p 3"]]:
    """Find for places the nearest of some edges by samples along all: its number, how far along it (0 to 1), and where."""
    first, way = ends[:, 0], ends[:, 1] - ends[:, 0]
    count = 2 + (np.linalg.norm(way, axis=1) * SAMPLES / reach).astype(int)
    edge = np.repeat(np.arange(len(count)), count)
    number = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    part = (number / (count[edge] - 1))[:, None]
    edge = edge[np.asarray(KDTree(first[edge] + part * way[edge]).query(xyz)[1])]
    square = np.maximum((way[edge] ** 2).sum(axis=1), 1e-300)
    along = (((xyz - first[edge]) * way[edge]).sum(axis=1) / square).clip(0, 1)
    return edge, along, first[edge] + along[:, None] * way[edge]


def _insert(
    shape: Shape, rim: _Rim, edge: Int[np.ndarray, " n"], along: Float[np.ndarray, " n"], xyz: Float[np.ndarray, "n 3"]
) -> Shape:
    """Return the mesh with more corners in edges of its rim: the triangle at each becomes a fan about the corner opposite."""
    order = np.lexsort((along, edge))
    edge, new = edge[order], len(shape.xyz) + order
    starts, ends = np.r_[True, edge[1:] != edge[:-1]][: len(edge)], np.r_[edge[1:] != edge[:-1], True][: len(edge)]
    tip = shape.triangles[rim.triangle, (rim.corner + 2) % 3]
    before = np.where(starts, rim.ends[edge, 0], np.roll(new, 1))
    fans = [np.stack([before, new, tip[edge]], 1), np.stack([new, rim.ends[edge, 1], tip[edge]], 1)[ends]]
    kept = np.ones(len(shape.triangles), bool)
    kept[rim.triangle[edge]] = False
    triangles = np.concatenate([shape.triangles[kept], *fans]).astype(np.int32)
    return Shape(np.concatenate([shape.xyz, xyz]), triangles)


def _welded(shape: Shape, some: Bool[np.ndarray, " v"]) -> Shape:
    """Make one corner of those of `some` that are at one place; triangles that this leaves without a side go."""
    chosen = np.flatnonzero(some)
    _, first, own = np.unique(shape.xyz[chosen], axis=0, return_index=True, return_inverse=True)
    corner = np.arange(len(shape.xyz))
    corner[chosen] = chosen[first[own.ravel()]]
    a, b, c = corner[shape.triangles].T
    return Shape(shape.xyz, np.stack([a, b, c], 1).astype(np.int32)).keep((a != b) & (b != c) & (c != a))
