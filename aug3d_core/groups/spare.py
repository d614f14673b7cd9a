"""Which photographs show nothing of their own: enough others show the same."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int
from scipy import sparse

MOST_SHOWN = 0.9  # share of the surface in a photograph that enough others show as well


def spare_views(
    seen: sparse.csr_array, candidates: Int[np.ndarray, " m"], others: Int[np.ndarray, " o"], enough: int
) -> Int[np.ndarray, " s"]:
    """Return candidates to leave out, so that `enough` views that stay show MOST_SHOWN of the surface of each, or more.

    seen: views x parts of the surface, above 0 where a view shows a part. others: views that stay in any case. Candidates
    are tried one after the other, those first whose surface most others show; so of views that show the same, as many stay
    as are enough. A view that shows nothing is not spare: nothing tells that others show the same.
    """
    sees = sparse.csr_array(seen > 0, dtype=np.int32)
    shown = sparse.csr_array(sees[candidates])
    by_part = sparse.csc_array(shown)
    count = shown.sum(axis=0) + sees[others].sum(axis=0)  # of the views that stay, by part
    parts = [shown.indices[a:b] for a, b in zip(shown.indptr[:-1], shown.indptr[1:], strict=True)]
    size = np.array([len(own) for own in parts])
    covered = np.array([np.sum(count[own] > enough) for own in parts])  # parts that enough others show
    left_out = np.zeros(len(parts), bool)
    for row in np.argsort(-covered / np.maximum(size, 1), kind="stable"):
        own = parts[row]
        needed = own[count[own] == enough]
        fewer = covered - np.where(left_out, by_part[:, needed].sum(axis=1), 0)
        fewer[row] = np.sum(count[own] > enough)
        if len(own) and (fewer >= MOST_SHOWN * size)[left_out | (np.arange(len(parts)) == row)].all():
            count[own] -= 1
            left_out[row], covered = True, fewer
    return np.sort(candidates[left_out])
