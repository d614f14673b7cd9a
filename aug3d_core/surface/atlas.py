"""Where each triangle lies in the texture: charts of triangles that face one way, seen straight on, packed on shelves.

A chart is the surface's own shadow on a plane, so that a texel has the same size everywhere, stretched by at most
1 / cos of the angle between triangle and plane. Where a chart would cover itself, the covered triangles get another.
A chart longer than `SIDE` is turned to where its box is smallest and cut into parts, so that the picture is filled and
nearly square whatever the shape and heading of the ground. Parts keep their chart's raster of texels: what one shows
beyond its border is in another, texel by texel.
open3d's UVAtlas stretches less, but took longer than all else (20 to 40 s for 20,000 to 60,000 triangles) and needs a
manifold.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import sparse
from scipy.sparse import csgraph

from aug3d_core.geometry.raycast import Hits, Raycaster
from aug3d_core.surface.shape import Shape, triangle_neighbours, triangle_normals

GUTTER = 2  # texels around a chart, so that sampling between texels takes nothing from the next chart
MARGIN = 8  # texels around a part of a chart: viewers of the ground from afar see several as one
SIDE = 2048  # texels of a chart's longer side from which it is cut
LEAST_SIDE = 256  # texels of a part's longer side up to which nothing is gained by cutting it
OVERHANG = 1.25  # of a part's box: what its halves' boxes take at most, whose triangles lie across the cut
SAVING = 0.9  # of a part's box: what its halves' boxes take at most if it is cut for the empty texels in it alone
LONGEST = 16_384  # texels of the picture's longer side: what GPUs, and with them browsers, take
SMOOTH_ROUNDS = 3
LEAST_COSINE = 0.5  # a triangle may join its neighbours' chart if it is seen at least so straight there
MOST_LAYERS = 4
LEAST_GROWTH = 1.02  # of a texel from try to try
STRETCHES = np.linspace(1, 1.25, 11)  # of the picture's width, to see with which shelves waste least
_TURNED_BY = 20_000  # triangles of a chart that tell how to turn it
RAYS = 2**21  # at a time: bounds memory


@dataclass(frozen=True)
class Parts:
    """The boxes, margins included, of the parts that charts were cut into, in texels: x right, y down.

    `corner` is a box's top left corner on its chart's own raster, `place` that in the picture.
    """

    chart: Int[np.ndarray, " w"]
    corner: Int[np.ndarray, "w 2"]
    place: Int[np.ndarray, "w 2"]
    size: Int[np.ndarray, "w 2"]

    def shared(self) -> Iterator[tuple[tuple[slice, slice], tuple[slice, slice]]]:
        """Yield where two parts show the same texels of a chart: rows and columns of the picture in one, and in the other."""
        low = np.maximum(self.corner[:, None], self.corner)
        high = np.minimum((self.corner + self.size)[:, None], self.corner + self.size)
        both = (self.chart[:, None] == self.chart) & (low < high).all(axis=-1)
        for one, other in np.argwhere(both & ~np.eye(len(both), dtype=bool)):
            size = high[one, other] - low[one, other]
            here, there = (low[one, other] - self.corner[part] + self.place[part] for part in (one, other))
            yield _window(here, size), _window(there, size)


_NO_PARTS = Parts(np.zeros(0, int), *np.zeros((3, 0, 2), int))


@dataclass(frozen=True)
class Atlas:
    """Texture coordinates in texels, x right and y down from the picture's top left corner."""

    xy: Float[np.ndarray, "t 3 2"]
    width: int
    height: int
    charts: int  # parts of those that were cut count one by one
    parts: Parts = _NO_PARTS

    @property
    def uv(self) -> Float[np.ndarray, "t 3 2"]:
        """Coordinates from 0 to 1, v up."""
        return self.xy / (self.width, -self.height) + (0, 1)

    def triangle_of_texels(self) -> Int[np.ndarray, "h w"]:
        """Return for each texel's centre the triangle that it lies in; -1: none."""
        triangle = np.empty(self.height * self.width, np.int32)
        for first in range(0, len(triangle), RAYS):
            texel = np.arange(first, min(first + RAYS, len(triangle)))
            triangle[texel] = self.hits(texel).triangle
        return triangle.reshape(self.height, self.width)

    def hits(self, texel: Int[np.ndarray, " p"]) -> Hits:
        """Return what the centres of texels, by their number row by row, lie in: triangles and barycentric weights."""
        row, column = np.divmod(texel, self.width)
        return _look_down(self._caster, np.stack([column, row], axis=-1) + 0.5)

    def covered(self) -> Bool[np.ndarray, " t"]:
        """Tell which triangles lie under another of the texture."""
        found = _look_down(self._caster, self.xy.mean(axis=1)).triangle
        return (found >= 0) & (found != np.arange(len(self.xy)))

    @cached_property
    def _caster(self) -> Raycaster:
        flat = np.concatenate([self.xy, np.zeros((*self.xy.shape[:2], 1))], axis=-1).reshape(-1, 3)
        return Raycaster(flat, np.arange(len(flat), dtype=np.int32).reshape(-1, 3))


def make_atlas(shape: Shape, texel: float) -> Atlas:
    """Lay a mesh out with texels of this size (world units)."""
    frame = _frames()
    pairs = triangle_neighbours(shape)
    facing = _facing(triangle_normals(shape), frame[:, 2], pairs)
    centred = shape.xyz - shape.xyz.mean(axis=0)
    xy = np.einsum("txk,tyk->txy", centred[shape.triangles], frame[facing][:, :2]) / texel
    chart = _charts(facing, pairs)
    atlas, layer = _lay_out(xy, chart), np.zeros(len(facing), int)
    for _ in range(MOST_LAYERS):
        covered = atlas.covered()
        if not covered.any():
            break
        layer[covered] += 1
        chart = _charts(layer * len(frame) + facing, pairs)
        atlas = _lay_out(xy, chart)
    low, high = _boxes(xy, chart)
    large = np.flatnonzero((high - low).max(axis=1) > SIDE)
    return _lay_out_parts(xy, chart, large) if len(large) else atlas


def atlas_within(shape: Shape, texel: float, budget: int) -> tuple[Atlas, float]:
    """Lay a mesh out with texels of this size (world units), or as much larger as the budget asks; return it and the size.

    How much the gutters of small charts take, and what shelves waste, is known only afterwards. Charts of one texel with
    their gutters are the least that a mesh can take: a budget below that is not kept. No side is longer than `LONGEST`.
    """
    atlas = make_atlas(shape, texel)
    while (over := _excess(atlas, budget)) > 1:
        larger = texel * max(np.sqrt(over), LEAST_GROWTH)
        smaller = make_atlas(shape, larger)
        if _excess(smaller, budget) >= over:
            break
        atlas, texel = smaller, larger
    return atlas, texel


def _excess(atlas: Atlas, budget: int) -> float:
    """Return how many times as many texels as it may have an atlas has."""
    return max(atlas.width * atlas.height / budget, (max(atlas.width, atlas.height) / LONGEST) ** 2)


def _look_down(caster: Raycaster, xy: Float[np.ndarray, "*p 2"]) -> Hits:
    return caster.cast(np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1), np.array([0.0, 0.0, -1.0]))


def _frames() -> Float[np.ndarray, "d 3 3"]:
    """Return the planes' axes (right, down, towards the viewer), for up, down, and eight level headings."""
    frames = [((1, 0, 0), (0, -1, 0), (0, 0, 1)), ((1, 0, 0), (0, 1, 0), (0, 0, -1))]
    for heading in np.arange(8) * np.pi / 4:
        c, s = np.cos(heading), np.sin(heading)
        frames.append(((-s, c, 0), (0, 0, -1), (c, s, 0)))
    return np.array(frames, float)


def _facing(normals: np.ndarray, directions: np.ndarray, pairs: np.ndarray) -> Int[np.ndarray, " t"]:
    """Choose each triangle's plane: the straightest, then that of most neighbours if it is straight enough."""
    cosine = normals @ directions.T
    facing = cosine.argmax(axis=1)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    graph = sparse.csr_matrix((np.ones(len(both)), both.T), shape=(len(normals), len(normals)))
    for _ in range(SMOOTH_ROUNDS):
        votes = graph @ np.eye(len(directions))[facing]
        votes[np.arange(len(facing)), facing] += 0.5
        facing = np.where(cosine > LEAST_COSINE, votes, -1.0 + 1e-3 * cosine).argmax(axis=1)
    return facing


def _charts(kind: Int[np.ndarray, " t"], pairs: Int[np.ndarray, "e 2"]) -> Int[np.ndarray, " t"]:
    """Number the connected pieces of triangles of one kind."""
    same = pairs[kind[pairs[:, 0]] == kind[pairs[:, 1]]]
    graph = sparse.coo_matrix((np.ones(len(same), bool), same.T), shape=(len(kind), len(kind)))
    return csgraph.connected_components(graph, directed=False)[1]


def _boxes(xy: Float[np.ndarray, "t 3 2"], chart: Int[np.ndarray, " t"]) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of charts' boxes, one row a chart."""
    low, high = np.full((chart.max() + 1, 2), np.inf), np.full((chart.max() + 1, 2), -np.inf)
    np.minimum.at(low, chart, xy.min(axis=1))
    np.maximum.at(high, chart, xy.max(axis=1))
    return low, high


def _lay_out(xy: Float[np.ndarray, "t 3 2"], chart: Int[np.ndarray, " t"]) -> Atlas:
    low, high = _boxes(xy, chart)
    size = np.ceil(high - low).astype(int) + 2 * GUTTER
    place, width, height = pack(size)
    return Atlas(xy + (place + GUTTER - low)[chart][:, None], width, height, len(low))


def _lay_out_parts(xy: Float[np.ndarray, "t 3 2"], chart: Int[np.ndarray, " t"], large: Int[np.ndarray, " l"]) -> Atlas:
    """Lay charts out of which the large ones are turned and cut."""
    xy, part, of = xy.copy(), chart.copy(), list(range(chart.max() + 1))  # of: the chart of each part
    for one in large:
        mine = np.flatnonzero(chart == one)
        xy[mine] = _turned(xy[mine])
        for other in _cut(xy[mine].min(axis=1).T.copy(), xy[mine].max(axis=1).T.copy())[1:]:
            part[mine[other]] = len(of)
            of.append(one)
    cut = np.isin(of, large)
    low, high = _boxes(xy, part)
    low[cut] = np.floor(low[cut])  # so that parts keep the raster
    margin = np.where(cut, MARGIN, GUTTER)[:, None]
    size = np.ceil(high - low).astype(int) + 2 * margin
    place, width, height = min((pack(size, stretch) for stretch in STRETCHES), key=lambda packed: packed[1] * packed[2])
    parts = Parts(np.array(of)[cut], (low - margin)[cut].astype(int), place[cut], size[cut])
    return Atlas(xy + (place + margin - low)[part][:, None], width, height, len(of), parts)


def _turned(xy: Float[np.ndarray, "t 3 2"]) -> Float[np.ndarray, "t 3 2"]:
    """Turn a chart by as many degrees as make its box smallest."""
    x, y = xy[:: -(-len(xy) // _TURNED_BY)].reshape(-1, 2).T.copy()
    axes = np.radians(np.arange(180))
    wide = np.array([np.ptp(np.cos(axis) * x + np.sin(axis) * y) for axis in axes])
    best = axes[(wide[:90] * wide[90:]).argmin()]
    c, s, x, y = np.cos(best), np.sin(best), xy[..., 0], xy[..., 1]
    return np.stack([c * x + s * y, c * y - s * x], axis=-1)


def _cut(low: Float[np.ndarray, "2 t"], high: Float[np.ndarray, "2 t"]) -> list[Int[np.ndarray, " n"]]:
    """Cut a chart of triangles with these boxes (texels) into parts, and return the triangles of each.

    A part is halved across its longer side while that is longer than `SIDE`, then either way where it saves empty texels. It
    stays whole where triangles so long lie across the cut that their boxes would take more than is gained.
    """
    parts, left = list[np.ndarray](), [np.arange(low.shape[1])]
    while left:
        part = left.pop()
        size = _size(low[:, part], high[:, part])
        long = size.max() > SIDE
        ways = [_halves(low[axis], high[axis], part) for axis in ([size.argmax()] if long else (0, 1))]
        taken = [sum(_texels(low[:, half], high[:, half]) for half in way) / size.prod() for way in ways]
        if size.max() > LEAST_SIDE and min(taken) <= (OVERHANG if long else SAVING):
            left += ways[int(np.argmin(taken))]
        else:
            parts.append(part)
    return parts


def _halves(
    low: Float[np.ndarray, " t"], high: Float[np.ndarray, " t"], part: Int[np.ndarray, " n"]
) -> list[np.ndarray]:
    """Sort the triangles of a part to either side of its middle along an axis."""
    first = low[part] + high[part] < low[part].min() + high[part].max()
    return [part[first], part[~first]]


def _size(low: Float[np.ndarray, "2 t"], high: Float[np.ndarray, "2 t"]) -> Float[np.ndarray, " 2"]:
    return high.max(axis=1) - low.min(axis=1) + 2 * MARGIN


def _texels(low: Float[np.ndarray, "2 t"], high: Float[np.ndarray, "2 t"]) -> float:
    """Return what the box of triangles takes; without a triangle there is none to be had."""
    return float(_size(low, high).prod()) if low.size else np.inf


def _window(corner: Int[np.ndarray, " 2"], size: Int[np.ndarray, " 2"]) -> tuple[slice, slice]:
    (x, y), (width, height) = corner, size
    return slice(y, y + height), slice(x, x + width)


def pack(size: Int[np.ndarray, "c 2"], stretch: float = 1.0) -> tuple[Int[np.ndarray, "c 2"], int, int]:
    """Place boxes (width, height) on shelves, the tallest first; return their top left corners, and width and height.

    stretch: of the width, from that of a square without a gap.
    """
    width = max(int(size[:, 0].max()), int(np.ceil(stretch * np.sqrt(size.prod(axis=1).sum()))))
    place = np.zeros_like(size)
    x, y, shelf = 0, 0, 0
    for box in np.lexsort((size[:, 0], -size[:, 1])):
        if x + size[box, 0] > width:
            x, y, shelf = 0, y + shelf, 0
        place[box] = x, y
        x, shelf = x + int(size[box, 0]), max(shelf, int(size[box, 1]))
    return place, width, y + shelf
