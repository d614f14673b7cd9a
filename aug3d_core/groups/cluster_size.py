"""How many views make a group: the largest K whose members still overlap with the group's centre.

The paper tries 20 and 10, and gains more from the step down than from all its rendering: views that see something else
confuse a model, and too few tell it little. So K is as large as overlap allows, and not above the paper's 10. On ochota,
where 20 would overlap as well, a model trained on groups of 10 is better by 0.7 dB (`aug3d study grouping`).

Two views count as overlapping from a shared share (shared points over the geometric mean of what each sees) of 0.05. That
figure was measured against true overlap of seen surface, by rays on the mesh: on the town (60 photographs, exact mesh) all
of the pairs from 0.1 on, 72 % of those between 0.05 and 0.1, and 20 % of those between 0.02 and 0.05 overlap by at least a
tenth; on ochota and brighton, by their own meshes, 100 %, 99 % and 97 %, where few points are shared by views far apart.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

from aug3d_core.groups.config import MOST_K
from aug3d_core.groups.methods.shared_points import OVERLAPS

_MOST_APART = 0.05  # share of members that may fail to overlap
_LEAST = 4  # three views to look from, as every preset has it, and one to predict


def cluster_size(similarity: sparse.csr_array, candidates: Int[np.ndarray, " m"]) -> tuple[int, str]:
    """Return the largest K (4 to 10) at which at most 5 % of members do not overlap with their centre, and why.

    Fewer than 4 where there are fewer, 2 where nothing overlaps. At least two candidates are needed. Every one that overlaps
    with any other is taken for a centre once, with the views most similar to it.
    """
    ranked = _ranked(similarity[candidates][:, candidates], min(MOST_K, len(candidates)) - 1)
    ranked = ranked[ranked[:, 0] >= OVERLAPS]
    if not len(ranked):
        return 2, "no two views overlap"
    apart = np.cumsum((ranked < OVERLAPS).mean(axis=0)) / np.arange(1, ranked.shape[1] + 1)
    overlapping = int(np.flatnonzero(apart <= _MOST_APART)[-1]) + 2
    k = max(overlapping, min(_LEAST, len(candidates)))
    if k == MOST_K:
        return (
            k,
            f"{apart[-1]:.0%} of the members do not overlap with their centre, and more than the paper's {k} made models worse",
        )
    if k > overlapping:
        return k, f"{apart[k - 2]:.0%} of the members do not overlap with their centre, but fewer leave none to predict"
    if k == len(candidates):
        return k, f"there are {k} views"
    return (
        k,
        f"{apart[k - 2]:.0%} of the members do not overlap with their centre; with {k + 1} it would be {apart[k - 1]:.0%}",
    )


def _ranked(similarity: sparse.csr_array, most: int) -> Float[np.ndarray, "m most"]:
    """Return for each view its greatest similarities with others, the greatest first."""
    values = np.zeros((len(similarity.indptr) - 1, most))
    for view, (start, end) in enumerate(zip(similarity.indptr[:-1], similarity.indptr[1:], strict=True)):
        others = similarity.data[start:end][similarity.indices[start:end] != view]
        best = np.sort(others)[::-1][:most]
        values[view, : len(best)] = best
    return values
