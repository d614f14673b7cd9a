"""Where a reconstruction hinges: two parts of a flight that few points join may be turned against each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

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
    found = [_cut(sees, tree, edge, typical) for edge in range(tree.nnz)]
    large = [joint for joint in found if joint.photos >= max(_FEWEST, _SMALLEST_PART * photos)]
    return min(large, key=lambda joint: joint.points, default=None)


def _cut(sees: sparse.csr_array, tree: sparse.csr_array, edge: int, typical: float) -> Joint:
    left = tree.tocoo()
    kept = np.arange(left.nnz) != edge
    halves = sparse.csr_array((left.data[kept], (left.row[kept], left.col[kept])), shape=left.shape)
    _, part = connected_components(halves, directed=False)
    one = part == part[left.row[edge]]
    points = int(((one @ sees > 0) & (~one @ sees > 0)).sum())
    return Joint(points, int(min(one.sum(), (~one).sum())), points / typical)
