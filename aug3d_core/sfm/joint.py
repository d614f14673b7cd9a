"""Where a reconstruction hinges: two parts of a flight that few points join may be turned against each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

from aug3d_core.geometry.views import Tracks

_SMALLEST_PART = 0.1  # of the photographs; a few at the rim hang on by less, and turn nothing but themselves
_FEWEST = 3


@dataclass(frozen=True)
class Joint:
    """What joins two parts. points: seen by both. photos: in the smaller part. share: points over those of a photograph."""

    points: int
    photos: int
    share: float


def weakest_joint(tracks: Tracks, photos: int) -> Joint | None:
    """Return the weakest joint between two parts of the photographs; None where no part is large enough to count.

    Parts are what cutting one edge of the maximum spanning tree leaves, in which two photographs are joined by the points
    that both see.
    """
    seen = np.unique(np.column_stack([tracks.view, tracks.point]), axis=0)
    sees = sparse.csr_array((np.ones(len(seen), np.int64), tuple(seen.T)), shape=(photos, int(seen[:, 1].max()) + 1))
    shared = (sees @ sees.T).tocoo()
    apart = shared.row != shared.col
    edges = shared.row[apart], shared.col[apart]
    tree = minimum_spanning_tree(sparse.csr_array((1 / shared.data[apart], edges), shape=shared.shape))
    typical = float(np.median(sees.sum(axis=1)))
    # Most edges of a tree cut off a photograph or two: what they join is not counted.
    large = np.flatnonzero(_smaller_parts(tree) >= max(_FEWEST, _SMALLEST_PART * photos)).tolist()
    return min((_cut(sees, tree, edge, typical) for edge in large), key=lambda joint: joint.points, default=None)


def _smaller_parts(tree: sparse.csr_array) -> Int[np.ndarray, " e"]:
    """Return for each edge of a tree, or of several, how many are on the smaller side of it: beyond its row, or all others."""
    _, part = connected_components(tree, directed=False)
    edges, count = tree.tocoo(), len(part)
    _, first, size = np.unique(part, return_index=True, return_counts=True)
    rows, columns = (
        np.append(edges.row, np.full(len(first), count)),
        np.append(edges.col, first),
    )  # all hang on one root
    rooted = sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(count + 1, count + 1))
    order, above = breadth_first_order(rooted, count, directed=False)
    hanging = np.ones(count + 1, np.int64)
    for one in order[:0:-1]:
        hanging[above[one]] += hanging[one]
    away = above[edges.row] == edges.col
    beyond_row = np.where(away, hanging[edges.row], size[part[edges.row]] - hanging[edges.col])
    return np.minimum(beyond_row, count - beyond_row)


def _cut(sees: sparse.csr_array, tree: sparse.csr_array, edge: int, typical: float) -> Joint:
    left = tree.tocoo()
    kept = np.arange(left.nnz) != edge
    halves = sparse.csr_array((left.data[kept], (left.row[kept], left.col[kept])), shape=left.shape)
    _, part = connected_components(halves, directed=False)
    one = part == part[left.row[edge]]
    points = int(((one @ sees > 0) & (~one @ sees > 0)).sum())
    return Joint(points, int(min(one.sum(), (~one).sum())), points / typical)
