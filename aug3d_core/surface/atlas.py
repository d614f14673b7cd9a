"""Where each triangle lies in the texture: charts of triangles that face one way, seen straight on, packed on shelves.

A chart is the surface's own shadow on a plane, so that a texel has the same size everywhere, stretched by at most
1 / cos of the angle between triangle and plane. Where a chart would cover itself, the covered triangles get another.
open3d's UVAtlas stretches less, but took longer than all else (20 to 40 s for 20,000 to 60,000 triangles) and needs a
manifold.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import sparse
from scipy.sparse import csgraph

from aug3d_core.geometry.raycast import Hits, Raycaster
from aug3d_core.surface.shape import Shape, triangle_neighbours, triangle_normals

GUTTER = 2  # texels around a chart, so that sampling between texels takes nothing from the next chart
SMOOTH_ROUNDS = 3
LEAST_COSINE = 0.5  # a triangle may join its neighbours' chart if it is seen at least so straight there
MOST_LAYERS = 4
LEAST_GROWTH = 1.02  # of a texel from try to try
RAYS = 2**21  # at a time: bounds memory


@dataclass(frozen=True)
class Atlas:
    """Texture coordinates in texels, x right and y down from the picture's top left corner."""

    xy: Float[np.ndarray, "t 3 2"]
    width: int
    height: int
    charts: int

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
    layer = np.zeros(len(facing), int)
    atlas = _lay_out(shape, frame, facing, layer, pairs, texel)
    for _ in range(MOST_LAYERS):
        covered = atlas.covered()
        if not covered.any():
            break
        layer[covered] += 1
        atlas = _lay_out(shape, frame, facing, layer, pairs, texel)
    return atlas


def atlas_within(shape: Shape, texel: float, budget: int) -> tuple[Atlas, float]:
    """Lay a mesh out with texels of this size (world units), or as much larger as the budget asks; return it and the size.

    How much the gutters of small charts take, and what shelves waste, is known only afterwards. Charts of one texel with
    their gutters are the least that a mesh can take: a budget below that is not kept.
    """
    atlas = make_atlas(shape, texel)
    while (over := atlas.width * atlas.height / budget) > 1:
        larger = texel * max(np.sqrt(over), LEAST_GROWTH)
        smaller = make_atlas(shape, larger)
        if smaller.width * smaller.height >= atlas.width * atlas.height:
            break
        atlas, texel = smaller, larger
    return atlas, texel


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


def _lay_out(
    shape: Shape, frame: np.ndarray, facing: np.ndarray, layer: np.ndarray, pairs: np.ndarray, texel: float
) -> Atlas:
    kind = layer * len(frame) + facing
    same = pairs[kind[pairs[:, 0]] == kind[pairs[:, 1]]]
    graph = sparse.coo_matrix((np.ones(len(same), bool), same.T), shape=(len(kind), len(kind)))
    charts, chart = csgraph.connected_components(graph, directed=False)
    centred = shape.xyz - shape.xyz.mean(axis=0)
    xy = np.einsum("txk,tyk->txy", centred[shape.triangles], frame[facing][:, :2]) / texel
    low, high = np.full((charts, 2), np.inf), np.full((charts, 2), -np.inf)
    np.minimum.at(low, chart, xy.min(axis=1))
    np.maximum.at(high, chart, xy.max(axis=1))
    size = np.ceil(high - low).astype(int) + 2 * GUTTER
    place, width, height = pack(size)
    return Atlas(xy + (place + GUTTER - low)[chart][:, None], width, height, charts)


def pack(size: Int[np.ndarray, "c 2"]) -> tuple[Int[np.ndarray, "c 2"], int, int]:
    """Place boxes (width, height) on shelves, the tallest first; return their top left corners, and width and height."""
    width = max(int(size[:, 0].max()), int(np.ceil(np.sqrt(size.prod(axis=1).sum()))))
    place = np.zeros_like(size)
    x, y, shelf = 0, 0, 0
    for box in np.lexsort((size[:, 0], -size[:, 1])):
        if x + size[box, 0] > width:
            x, y, shelf = 0, y + shelf, 0
        place[box] = x, y
        x, shelf = x + int(size[box, 0]), max(shelf, int(size[box, 1]))
    return place, width, y + shelf
