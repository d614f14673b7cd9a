"""Choosing sets so that few of them cover much: greedily, which is within 1 - 1/e of the best (Nemhauser et al. 1978).

A set's gain only falls as others are taken. So the largest gain known from before is looked at first, and most sets need
not be looked at again: Minoux, "Accelerated greedy algorithms for maximizing submodular set functions" (1978).
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Bool, Float, Int


def greedy(
    sets: Sequence[Int[np.ndarray, " _"]], covered: Bool[np.ndarray, " u"], worth: Float[np.ndarray, " u"]
) -> Iterator[tuple[int, float]]:
    """Yield each set's index and what it adds, the one that adds most first (equals: the first).

    `covered` tells what is covered before, and is kept up to date; `worth` is what each element counts. No set holds an
    element twice.
    """
    heap = [(-float(worth[members].sum()), index, -1) for index, members in enumerate(sets)]
    heapq.heapify(heap)
    taken = 0
    while heap:
        gain, index, at = heapq.heappop(heap)
        if at < taken:
            heapq.heappush(heap, (-added(sets[index], covered, worth), index, taken))
            continue
        covered[sets[index]] = True
        taken += 1
        yield index, -gain


def added(members: Int[np.ndarray, " s"], covered: Bool[np.ndarray, " u"], worth: Float[np.ndarray, " u"]) -> float:
    """Return what a set's elements that are not covered count together."""
    return float(worth[members[~covered[members]]].sum())
