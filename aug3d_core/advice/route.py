"""The order in which places are flown: a short way through all of them, which passes above what stands on it."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

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


def cleared(
    places: Float[np.ndarray, "n 3"],
    floor_at: Callable[[Float[np.ndarray, "m 2"]], Float[np.ndarray, " m"]],
    step: float,
) -> Float[np.ndarray, "n 3"]:
    """Return places in their order, raised so that no leg between two of them is below the floor.

    The lower end of a leg is raised as little as it must; where the floor is above both ends, both are raised to it.
    step: along the legs, at most, from one place to the next that is looked at.
    """
    places = places.copy()
    for i in range(len(places) - 1):
        low, high = sorted((i, i + 1), key=lambda end: places[end, 2])
        way = along(places[[low, high]], step)
        floor, share = floor_at(way[:, :2]), np.linspace(0, 1, len(way))
        if floor.max() > places[high, 2]:
            places[i : i + 2, 2] = floor.max()
        else:
            least = (floor[:-1] - share[:-1] * places[high, 2]) / (1 - share[:-1])
            places[low, 2] = least.max(initial=places[low, 2])
    return places


def along(places: Float[np.ndarray, "n 3"], step: float) -> Float[np.ndarray, "m 3"]:
    """Return places, and between each two of them others on the straight leg, at most a step apart."""
    legs = [places[:1]]
    for start, end in pairwise(places):
        count = int(np.ceil(np.linalg.norm(end - start) / step))
        legs.append(start + np.linspace(0, 1, count + 1)[1:, None] * (end - start))
    return np.concatenate(legs)
