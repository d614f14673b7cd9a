"""A route goes through all places, is short, and passes above what stands on it."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from aug3d_core.advice.route import along, cleared, route


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


def ridge(xy: np.ndarray) -> np.ndarray:
    """Return a floor: 30, and from 40 to 50 m east 80."""
    return np.where(np.abs(xy[:, 0] - 45) < 5, 80.0, 30.0)


@pytest.mark.parametrize("seed", range(5))
def test_no_leg_is_below_the_floor_and_no_place_is_lowered(seed: int) -> None:
    rng = np.random.default_rng(seed)
    places = np.column_stack([rng.uniform(0, 100, (12, 2)), rng.uniform(30, 90, 12)])
    places[:, 2] = np.maximum(places[:, 2], ridge(places))
    found = cleared(places, ridge, 1.0)
    way = along(found, 1.0)
    assert (way[np.abs(way[:, 0] - 45) < 4, 2] >= 80 - 1e-6).all() and (found >= places).all()
    assert np.array_equal(found[:, :2], places[:, :2]) and not np.array_equal(found, places)
    assert np.array_equal(cleared(places, lambda xy: np.full(len(xy), 30.0), 1.0), places), (
        "where nothing is in the way"
    )


def test_the_lower_end_of_a_leg_is_raised_as_little_as_it_must() -> None:
    places = np.array([(0.0, 0, 35), (100.0, 0, 90), (100.0, 0, 90)])
    assert cleared(places, ridge, 0.1)[:, 2] == pytest.approx([73.3, 90, 90], abs=0.1)  # 80 at 41 m
    assert cleared(places * [1, 1, 0.5], ridge, 0.1)[:, 2] == pytest.approx([80, 80, 45])


@pytest.mark.parametrize("count", [0, 1, 4])
def test_places_of_a_way_are_at_most_a_step_apart(count: int) -> None:
    places = np.random.default_rng(0).uniform(0, 50, (count, 3))
    way = along(places, 2.0)
    assert all((np.abs(way - place).sum(axis=1) < 1e-9).any() for place in places)
    assert (np.linalg.norm(np.diff(way, axis=0), axis=1) <= 2 + 1e-9).all() and len(way) >= count
