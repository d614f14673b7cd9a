"""The order in which places are flown: a short way through all of them."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial.distance import cdist


def route(places: Float[np.ndarray, "n d"]) -> Int[np.ndarray, " n"]:
    """Return the order of an open way: the nearest place each time, then parts turned round while it gets shorter (2-opt)."""
    apart = cdist(places, places)
    left = list(range(1, len(places)))
    way = [0] if len(places) else []
    while left:
        way.append(left.pop(int(np.argmin(apart[way[-1], left]))))
    better = True
    while better:
        better = False
        for i in range(len(way) - 1):
            for j in range(i + 1, len(way)):
                after = apart[way[j], way[j + 1]] if j + 1 < len(way) else 0.0
                turned = apart[way[i + 1], way[j + 1]] if j + 1 < len(way) else 0.0
                if apart[way[i], way[j]] + turned < apart[way[i], way[i + 1]] + after - 1e-9:
                    way[i + 1 : j + 1] = way[i + 1 : j + 1][::-1]
                    better = True
    return np.array(way, int)
