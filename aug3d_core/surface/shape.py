"""Triangles without colours: cutting, cleaning and splitting, in plain numpy so that the bytes repeat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import sparse
from scipy.sparse import csgraph


@dataclass(frozen=True)
class Shape:
    """A triangle mesh; triangles wind counter-clockwise seen from outside."""

    xyz: Float[np.ndarray, "v 3"]
    triangles: Int[np.ndarray, "t 3"]

    def keep(self, triangle: Bool[np.ndarray, " t"]) -> Shape:
        """Return the chosen triangles and the vertices that they use."""
        used, index = np.unique(self.triangles[triangle], return_inverse=True)
        return Shape(self.xyz[used], index.reshape(-1, 3).astype(np.int32))


def triangle_areas(shape: Shape) -> Float[np.ndarray, " t"]:
    """Return the area of each triangle."""
    a, b, c = shape.xyz[shape.triangles.T]
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def triangle_normals(shape: Shape) -> Float[np.ndarray, "t 3"]:
    """Return the unit normal of each triangle, 0 where it has no area."""
    a, b, c = shape.xyz[shape.triangles.T]
    face = np.cross(b - a, c - a)
    return face / np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-30)


def vertex_normals(shape: Shape) -> Float[np.ndarray, "v 3"]:
    """Return unit normals, each the area-weighted mean of the triangles around a vertex."""
    a, b, c = shape.xyz[shape.triangles.T]
    face = np.cross(b - a, c - a)
    normals = np.stack([_sum_at_corners(shape, face[:, axis]) for axis in range(3)], axis=1)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)


def edges(shape: Shape) -> Int[np.ndarray, "e 2"]:
    """Return each edge once, the smaller vertex first, sorted."""
    key = np.unique(_edge_keys(shape))
    return np.stack(np.divmod(key, len(shape.xyz)), axis=1)


def triangle_neighbours(shape: Shape) -> Int[np.ndarray, "e 2"]:
    """Return the pairs of triangles that share an edge."""
    key = _edge_keys(shape)
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order[1:]] == key[order[:-1]])
    return np.stack([order[same], order[same + 1]], axis=1) % len(shape.triangles)


def drop_small_pieces(shape: Shape, worth: Float[np.ndarray, " v"], least: float) -> Shape:
    """Drop connected pieces whose vertices are worth less than this together; the best stays in any case."""
    if not len(shape.triangles):
        return shape
    pairs, count = edges(shape), len(shape.xyz)
    graph = sparse.coo_matrix((np.ones(len(pairs), bool), pairs.T), shape=(count, count))
    piece = csgraph.connected_components(graph, directed=False)[1]
    total = np.bincount(piece, worth)
    enough = total >= least
    enough[total.argmax()] = True
    return shape.keep(enough[piece[shape.triangles[:, 0]]])


def drop_degenerate(shape: Shape) -> Shape:
    """Drop triangles without area."""
    return shape.keep(triangle_areas(shape) > 0)


def split_to(shape: Shape, spacing: float, vertex_budget: int) -> Shape:
    """Split edges at their middles until none is longer than 1.5 `spacing` or the next round would break the budget.

    1.5: halving an edge just above it gives 0.75, so that edges end evenly around `spacing`.
    """
    while True:
        pairs = edges(shape)
        length = np.linalg.norm(shape.xyz[pairs[:, 0]] - shape.xyz[pairs[:, 1]], axis=1)
        long = np.flatnonzero(length > 1.5 * spacing)
        room = vertex_budget - len(shape.xyz)
        if not len(long) or room <= 0:
            return shape
        if len(long) > room:
            long = long[np.argsort(-length[long], kind="stable")[:room]]
        shape = _split_edges(shape, pairs, long)


def _split_edges(shape: Shape, pairs: np.ndarray, chosen: np.ndarray) -> Shape:
    """Split the chosen edges; a triangle with 1, 2 or 3 split edges becomes 2, 3 or 4 triangles."""
    middle_of = np.full(len(pairs), -1)
    middle_of[chosen] = len(shape.xyz) + np.arange(len(chosen))
    xyz = np.concatenate([shape.xyz, shape.xyz[pairs[chosen]].mean(axis=1)])
    edge = np.searchsorted(pairs[:, 0] * len(shape.xyz) + pairs[:, 1], _edge_keys(shape))
    middles = middle_of[edge].reshape(3, -1).T  # of edges ab, bc, ca
    count = (middles >= 0).sum(axis=1)
    parts = [shape.triangles[count == 0]]
    for triangles, mids in _turned(shape.triangles, middles, count):
        a, b, c = triangles.T
        ab, bc, ca = mids.T
        match (mids[0] >= 0).sum():
            case 1:
                parts += [np.stack(t, 1) for t in ((a, ab, c), (ab, b, c))]
            case 2:
                parts += [np.stack(t, 1) for t in ((ab, b, bc), (a, ab, bc), (a, bc, c))]
            case _:
                parts += [np.stack(t, 1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    return Shape(xyz, np.concatenate(parts).astype(np.int32))


def _turned(triangles: np.ndarray, middles: np.ndarray, count: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Group triangles by their number of split edges, turned so that the first edge is split and, of two, ca is not."""
    # The edge to become ab: the split one of one; of two, the one that follows the whole edge
    split = middles >= 0
    first = np.where(count == 1, split.argmax(axis=1), (np.argmin(split, axis=1) + 1) % 3)
    first[count == 3] = 0
    order = (first[:, None] + np.arange(3)) % 3
    triangles, middles = np.take_along_axis(triangles, order, 1), np.take_along_axis(middles, order, 1)
    return [(triangles[count == n], middles[count == n]) for n in (1, 2, 3) if (count == n).any()]


def _edge_keys(shape: Shape) -> np.ndarray:
    """Return one integer per edge ab of all triangles, then bc, then ca: far faster to sort and search than pairs."""
    a, b, c = shape.triangles.T.astype(np.int64)
    ends = np.stack([np.concatenate([a, b, c]), np.concatenate([b, c, a])])
    return ends.min(axis=0) * len(shape.xyz) + ends.max(axis=0)


def _sum_at_corners(shape: Shape, value: np.ndarray) -> np.ndarray:
    return np.bincount(shape.triangles.ravel(), np.repeat(value, 3), minlength=len(shape.xyz))
