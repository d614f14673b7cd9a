"""How good groups are, without training anything: what members share, what they really see of one another, what is left out.

A member is bad when its true overlap with the group's centre is under 10 %, a pair when that of any two members is. Members
that cannot be judged (the mesh shows too little of them) count neither as good nor as bad; `unjudged_share` tells how many.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

from aug3d_core.groups.audit import shared_within
from aug3d_core.overlap.pair_overlaps import PairOverlaps, bad_share


def measure(
    members: Int[np.ndarray, "c k"], shared: sparse.csr_array, overlaps: PairOverlaps, candidates: int
) -> dict[str, float | int | None]:
    """Return the figures of one set of groups, centre first in each, chosen among `candidates` views.

    shared_points_*: points that a member shares with its centre. coverage: share of the candidates that are in a group.
    jaccard_mean, jaccard_max: how alike two groups are (common views over all views of both), the mean over all pairs of
    groups, and the mean over groups of the most alike other; None for one group alone.
    """
    points = shared_within(shared, members)
    overlap = member_overlaps(members, overlaps)
    pairs = pairs_within(members)
    alike, others = jaccard(members, overlaps.views), ~np.eye(len(members), dtype=bool)
    return {
        "groups": len(members),
        "k": members.shape[1],
        "shared_points_mean": float(points.mean()),
        "shared_points_min": int(points.min()),
        "shared_points_p10": float(np.percentile(points, 10)),
        "overlap_mean": _mean(overlap),
        "bad_members_share": bad_share(overlap),
        "bad_pairs_share": bad_share(overlaps.of(pairs[:, 0], pairs[:, 1])),
        "unjudged_share": float(np.isnan(overlap).mean()),
        "coverage": len(np.unique(members)) / candidates,
        "jaccard_mean": _mean(alike[others]),
        "jaccard_max": _mean(np.where(others, alike, 0.0).max(axis=1)) if len(members) > 1 else None,
    }


def member_overlaps(members: Int[np.ndarray, "c k"], overlaps: PairOverlaps) -> Float[np.ndarray, "c k-1"]:
    """Return the true overlap of each member with its group's centre."""
    return overlaps.of(np.broadcast_to(members[:, :1], members[:, 1:].shape), members[:, 1:])


def pairs_within(members: Int[np.ndarray, "c k"]) -> Int[np.ndarray, "m 2"]:
    """Return every pair of members of each group."""
    one, other = np.triu_indices(members.shape[1], 1)
    return np.stack([members[:, one], members[:, other]], axis=-1).reshape(-1, 2)


def jaccard(members: Int[np.ndarray, "c k"], views: int) -> Float[np.ndarray, "c c"]:
    """Return how alike each two groups are: the views in both over the views in either."""
    count, k = members.shape
    ones = np.ones(members.size, np.int32)
    belongs = sparse.csr_array((ones, (np.repeat(np.arange(count), k), members.ravel())), shape=(count, views))
    common = (belongs @ belongs.T).toarray()
    return common / (2 * k - common)


def _mean(values: Float[np.ndarray, "*s"]) -> float | None:
    judged = values[np.isfinite(values)]
    return float(judged.mean()) if len(judged) else None
