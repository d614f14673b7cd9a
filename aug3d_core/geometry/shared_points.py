"""Shared points: the similarity of views is S = V V^T, where V (views x points) is 1 where a view sees a point.

S is symmetric; S_ij counts the points that views i and j both see, S_ii those that view i sees. (The paper writes V
points x views, and the product V^T V.)
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

from aug3d_core.geometry.views import Tracks


def visibility(tracks: Tracks, views: int, points: int) -> sparse.csr_array:
    """Return V. A point that a view sees twice (a false match within the track) counts once."""
    ones = np.ones(len(tracks.view), np.int32)
    matrix = sparse.coo_array((ones, (tracks.view, tracks.point)), shape=(views, points)).tocsr()
    matrix.sum_duplicates()
    matrix.data[:] = 1
    return matrix


def shared_points(visible: sparse.csr_array) -> sparse.csr_array:
    """Return S as int32; its indices are sorted, so that equal input gives equal bytes."""
    by_point = visible.T.tocsr()
    first_view = np.append(by_point.indices, 0)[by_point.indptr[:-1]]
    together = by_point[np.argsort(first_view, kind="stable")]  # points of one view side by side: thrice as fast
    shared = (together.T.tocsr() @ together).tocsr().astype(np.int32)
    shared.sort_indices()
    return shared


def look_positions(
    tracks: Tracks, xyz: Float[np.ndarray, "p 3"], views: int
) -> tuple[Float[np.ndarray, "n 2"], Int[np.ndarray, " n"]]:
    """Return the mean ground position of the points that each view sees, and their number; NaN for a blind view."""
    seen = np.bincount(tracks.view, minlength=views)
    with np.errstate(invalid="ignore"):
        means = [np.bincount(tracks.view, xyz[tracks.point, axis], views) / seen for axis in range(2)]
    return np.stack(means, axis=1), seen


def components(shared: sparse.csr_array, least: int) -> Int[np.ndarray, " n"]:
    """Return the number of the component of each view; views with at least `least` shared points are connected."""
    return sparse.csgraph.connected_components(shared >= least, directed=False)[1]


def share(common: sparse.csr_array) -> sparse.csr_array:
    """Return S_ij / sqrt(S_ii S_jj), between 0 and 1 (Salton's cosine); 0 for a view that sees nothing."""
    own = 1 / np.sqrt(np.maximum(common.diagonal(), 1))
    return sparse.csr_array(sparse.diags_array(own) @ common @ sparse.diags_array(own))
