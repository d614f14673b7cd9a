"""A route goes through all places, and is short."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from aug3d_core.advice.route import route


def length(places: np.ndarray, order: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(places[order], axis=0), axis=1).sum())


@pytest.mark.parametrize("count", [0, 1, 2, 7, 60])
def test_each_place_is_met_once(count: int) -> None:
    assert sorted(route(np.random.default_rng(count).uniform(0, 100, (count, 3)))) == list(range(count))


@pytest.mark.parametrize("seed", range(5))
def test_a_short_way_is_within_a_tenth_of_the_shortest_from_the_same_place(seed: int) -> None:
    places = np.random.default_rng(seed).uniform(0, 100, (8, 2))
    shortest = min(length(places, np.array([0, *rest])) for rest in permutations(range(1, 8)))
    assert length(places, route(places)) <= 1.1 * shortest
