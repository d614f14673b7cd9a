"""Choose positions spread evenly over the ground, or places in a row."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int, Shaped


def farthest_points(positions: Float[np.ndarray, "n 2"], count: int) -> Int[np.ndarray, " c"]:
    """Return indices of `count` positions, each the farthest from those before; the first is the nearest to the middle.

    Ties fall to the smaller index. With count >= n, all indices come back.
    """
    first = np.argmin(np.linalg.norm(positions - np.median(positions, axis=0), axis=1))
    chosen = [int(first)]
    distance = np.linalg.norm(positions - positions[first], axis=1)
    distance[first] = -1.0
    while len(chosen) < min(count, len(positions)):
        farthest = int(np.argmax(distance))
        chosen.append(farthest)
        distance = np.minimum(distance, np.linalg.norm(positions - positions[farthest], axis=1))
        distance[farthest] = -1.0
    return np.array(chosen)


def evenly_spread(row: Shaped[np.ndarray, " n"], most: int) -> Shaped[np.ndarray, " m"]:
    """Return at most `most` elements of a row, evenly spread, its ends among them if there are two or more."""
    return row[np.linspace(0, len(row) - 1, min(len(row), most)).round().astype(int)]
