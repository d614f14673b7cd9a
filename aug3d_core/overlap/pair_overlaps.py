"""The true overlaps of pairs of views, once measured; `true_overlap.py` says what they are, and measures them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

BAD = 0.10  # overlap with the group's centre under which a member counts as bad


@dataclass(frozen=True)
class PairOverlaps:
    """Overlaps (0 to 1) of some pairs among `views` views; NaN where the mesh shows too little of one to judge."""

    views: int
    key: Int[np.ndarray, " m"]  # of `pair_keys`, ascending
    value: Float[np.ndarray, " m"]

    def of(self, a: Int[np.ndarray, "*s"], b: Int[np.ndarray, "*s"]) -> Float[np.ndarray, "*s"]:
        """Return the overlaps of pairs; raises KeyError on a pair that was not measured."""
        key = pair_keys(a, b, self.views)
        place = np.searchsorted(self.key, key)
        if (place == len(self.key)).any() or not np.array_equal(self.key[place], key):
            raise KeyError("the overlap of some pair was not measured")
        return self.value[place]

    def joined(self, other: PairOverlaps) -> PairOverlaps:
        """Return the pairs of both."""
        key, first = np.unique(np.append(self.key, other.key), return_index=True)
        return PairOverlaps(self.views, key, np.append(self.value, other.value)[first])


def pair_keys(a: Int[np.ndarray, "*s"], b: Int[np.ndarray, "*s"], views: int) -> Int[np.ndarray, "*s"]:
    """Return one number for each pair of views, whichever comes first."""
    return np.minimum(a, b).astype(np.int64) * views + np.maximum(a, b)


def is_bad(overlap: Float[np.ndarray, "*s"]) -> Bool[np.ndarray, "*s"]:
    """Tell which overlaps are too small; what could not be judged is not bad."""
    return overlap < BAD


def bad_share(overlap: Float[np.ndarray, "*s"]) -> float | None:
    """Return the share of bad ones among those that could be judged; None if there are none."""
    judged = overlap[np.isfinite(overlap)]
    return float(is_bad(judged).mean()) if len(judged) else None
