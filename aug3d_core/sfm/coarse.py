"""Compare photographs coarsely, by few large features: several hundred times cheaper than matching them.

Large features survive blur and a change of scale best, and few of them fit a matrix product. Descriptors are whole numbers
of which every product stays below 2^24, so single precision is exact and any number of threads gives the same scores.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int, UInt8

from aug3d_core.run.stage import Progress

FEATURES = 256
ALIKE = (
    8  # on `ochota`, 96 % of the pairs with as many matches hold when matched fully, and 8 % of those with fewer than 5
)

_RATIO = 0.8
_LENGTH_SQUARED = 512.0**2  # what COLMAP scales a SIFT descriptor to
_REPORTED = 500

Compare = Callable[[Int[np.ndarray, "m 2"]], Int[np.ndarray, " m"]]


@runtime_checkable
class Look(Protocol):
    """How photographs are looked at before any is matched."""

    def compare(self, pairs: Int[np.ndarray, "m 2"]) -> Int[np.ndarray, " m"]:
        """Return how many features of each pair match."""
        ...

    def shortlist(self, wanted: Int[np.ndarray, " w"], most: int) -> Int[np.ndarray, "m 2"]:
        """Return the pairs of each wanted photograph with the `most` others that may look most like it."""
        ...


def largest(
    descriptors: UInt8[np.ndarray, "n 128"], scale_px: Float[np.ndarray, " n"], most: int = FEATURES
) -> UInt8[np.ndarray, "k 128"]:
    """Return the descriptors of the largest features."""
    return descriptors[np.argsort(-scale_px, kind="stable")[:most]]


def comparer(descriptors: Sequence[UInt8[np.ndarray, "_ 128"]], progress: Progress) -> Compare:
    """Return a function from pairs of photographs to how many of their features match."""

    def compare(pairs: Int[np.ndarray, "m 2"]) -> Int[np.ndarray, " m"]:
        scores = np.zeros(len(pairs), int)
        one, first = -1, np.zeros((0, 128), np.float32)
        for at, (i, j) in enumerate(pairs):
            if i != one:
                one, first = i, descriptors[i].astype(np.float32)
            scores[at] = common(first, descriptors[j].astype(np.float32))
            if at % _REPORTED == _REPORTED - 1 or at == len(pairs) - 1:
                progress(at + 1, len(pairs), "pairs of photographs ranked")
        return scores

    return compare


def common(first: Float[np.ndarray, "n 128"], second: Float[np.ndarray, "m 128"]) -> int:
    """Count the features that are each other's nearest, and clearly nearer than the next (Lowe 2004, section 7.1)."""
    if len(first) < 2 or len(second) < 2:
        return 0
    product = first @ second.T
    rows = np.arange(len(product))
    nearest = product.argmax(axis=1)
    best, best_of_column = product[rows, nearest], product.max(axis=0)
    product[rows, nearest] = -1
    # Half the squared distances; descriptors are rounded, so the same one twice may seem less than nothing apart.
    apart, next_apart = (np.maximum(_LENGTH_SQUARED - near, 0) for near in (best, product.max(axis=1)))
    clear = apart < _RATIO**2 * next_apart
    return int(np.count_nonzero(clear & (best == best_of_column[nearest])))
