"""The pairs compared are all, each photograph's neighbours by GPS, or those that look alike; wrong GPS is found out."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.csgraph import connected_components

from aug3d_core.geometry.geodesy import geodetic_from_enu
from aug3d_core.run.errors import InputError
from aug3d_core.sfm.config import MatchingConfig
from aug3d_core.sfm.pairs import (
    choose_pairs,
    drawn_pairs,
    exhaustive_pairs,
    gps_positions,
    joining_pairs,
    most_alike,
    neighbour_pairs,
    sequence_pairs,
)

STEP_M = 20.0
REACH_M = 60.0
CONFIG = MatchingConfig(exhaustive_limit=30, neighbours=8)


def photos_at(enu: np.ndarray) -> pd.DataFrame:
    geodetic = geodetic_from_enu(enu, np.array([52.2, 21.0, 150.0]))
    return pd.DataFrame(geodetic, columns=["lat_deg", "lon_deg", "alt_m"])


def grid(side: int, step_m: float = STEP_M) -> np.ndarray:
    east, north = np.meshgrid(np.arange(side), np.arange(side))
    return np.stack([east.ravel(), north.ravel(), np.full(side * side, 2.5)], axis=1) * step_m


class Within:
    """Scores that fall with the true distance and are 3 where nothing is shared; vectors that know the distance roughly."""

    def __init__(self, enu: np.ndarray) -> None:
        self.enu, self.ranked = enu, 0

    def compare(self, pairs: np.ndarray) -> np.ndarray:
        self.ranked += len(pairs)
        apart_m = np.linalg.norm(self.enu[pairs[:, 0]] - self.enu[pairs[:, 1]], axis=1)
        return np.where(apart_m < REACH_M, 100 - apart_m, 3).astype(int)

    def shortlist(self, wanted: np.ndarray, most: int) -> np.ndarray:
        apart_m = np.linalg.norm(self.enu[wanted][:, None] - self.enu, axis=2)
        apart_m *= np.random.default_rng(0).uniform(0.3, 3, apart_m.shape)
        apart_m[np.arange(len(wanted)), wanted] = np.inf
        best = np.argsort(apart_m, axis=1)[:, :most]
        return np.stack([np.repeat(wanted, most), best.ravel()], axis=1)


class NotAsked:
    """Nothing had to be looked at."""

    def compare(self, pairs: np.ndarray) -> np.ndarray:
        raise AssertionError("nothing had to be ranked")

    def shortlist(self, wanted: np.ndarray, most: int) -> np.ndarray:
        raise AssertionError("nothing had to be looked up")


def share_of_near(enu: np.ndarray, pairs: np.ndarray) -> float:
    """Return which share of the pairs of true neighbours is among the pairs."""
    chosen = {tuple(pair) for pair in pairs}
    return float(np.mean([tuple(pair) in chosen for pair in neighbour_pairs(enu[:, :2], 4)]))


@given(st.integers(2, 70))
def test_exhaustive_pairs_are_all_pairs_once(count: int) -> None:
    pairs = exhaustive_pairs(count)
    assert (pairs[:, 0] < pairs[:, 1]).all()
    assert len(np.unique(pairs, axis=0)) == len(pairs) == count * (count - 1) // 2


def test_exhaustive_pairs_use_few_photographs_at_a_time() -> None:
    pairs = exhaustive_pairs(100)
    assert max(len(np.unique(pairs[start : start + 400])) for start in range(0, len(pairs), 400)) <= 80


@given(st.integers(3, 40), st.integers(2, 8), st.integers(0, 2**31))
def test_each_photograph_meets_its_nearest(count: int, neighbours: int, seed: int) -> None:
    positions = np.random.default_rng(seed).normal(size=(count, 2)) * 100
    pairs = {tuple(pair) for pair in neighbour_pairs(positions, neighbours)}
    assert all(i < j for i, j in pairs)
    for i in range(count):
        distance = np.linalg.norm(positions - positions[i], axis=1)
        for j in np.argsort(distance)[1 : neighbours + 1]:
            assert (min(i, j), max(i, j)) in pairs


@given(st.integers(2, 30))
def test_each_photograph_meets_its_next_two(count: int) -> None:
    expected = {(i, j) for i in range(count) for j in range(i + 1, min(i + 3, count))}
    assert {tuple(pair) for pair in sequence_pairs(count)} == expected


def test_a_photograph_without_a_position_has_no_neighbours() -> None:
    positions = grid(6)[:, :2]
    positions[7] = np.nan
    assert 7 not in neighbour_pairs(positions, 4)


@settings(max_examples=30, deadline=None)
@given(st.integers(3, 40), st.integers(1, 8), st.integers(0, 2**31))
def test_each_photograph_meets_those_it_looks_most_like(count: int, neighbours: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    scores = rng.permutation(count * count).reshape(count, count)
    scores = np.maximum(scores, scores.T)
    np.fill_diagonal(scores, -1)
    ranked = exhaustive_pairs(count)
    wanted = np.flatnonzero(rng.random(count) < 0.7)
    pairs = {
        tuple(sorted(pair))
        for pair in most_alike(ranked, scores[ranked[:, 0], ranked[:, 1]], wanted, neighbours).tolist()
    }
    assert pairs == {
        (min(i, j), max(i, j)) for i in wanted for j in np.argsort(-scores[i])[: min(neighbours, count - 1)]
    }


@settings(max_examples=30, deadline=None)
@given(st.integers(10, 40), st.integers(0, 2**31))
def test_what_joins_all_parts_does_so_by_other_pairs_each_time(count: int, seed: int) -> None:
    ranked = exhaustive_pairs(count)
    pairs = joining_pairs(ranked, np.random.default_rng(seed).integers(1, 200, len(ranked)), count)
    assert 2 * (count - 1) < len(np.unique(pairs, axis=0)) == len(pairs) <= 3 * (count - 1)
    for tree in (pairs[: count - 1], pairs[count - 1 : 2 * (count - 1)]):
        graph = np.zeros((count, count))
        graph[tree[:, 0], tree[:, 1]] = 1
        assert connected_components(graph, directed=False)[0] == 1


def test_photographs_that_share_nothing_are_not_joined() -> None:
    assert len(joining_pairs(exhaustive_pairs(5), np.zeros(10, int), 5)) == 0


def test_drawn_pairs_depend_on_the_seed_alone() -> None:
    first, second = drawn_pairs(50, CONFIG), drawn_pairs(50, CONFIG)
    np.testing.assert_array_equal(first, second)
    assert len(drawn_pairs(50, MatchingConfig(seed=1))) > 0
    assert (first[:, 0] < first[:, 1]).all()


def test_few_photographs_are_all_compared() -> None:
    choice = choose_pairs(photos_at(grid(5)), MatchingConfig(exhaustive_limit=25), NotAsked())
    assert (len(choice.pairs), choice.by) == (300, "exhaustive")


def test_true_gps_gives_neighbours_alone() -> None:
    enu = grid(12)
    choice = choose_pairs(photos_at(enu), CONFIG, Within(enu))
    assert choice.by == "gps"
    assert len(choice.doubted) == 0
    assert len(choice.pairs) < 144 * 8
    assert share_of_near(enu, choice.pairs) == 1.0


def test_without_gps_those_that_look_alike_are_compared() -> None:
    enu = grid(12)
    choice = choose_pairs(photos_at(enu) * np.nan, CONFIG, Within(enu))
    assert choice.by == "coarse"
    assert len(choice.pairs) < 144 * 10
    assert share_of_near(enu, choice.pairs) == 1.0


def test_many_photographs_are_compared_coarsely_with_a_shortlist_alone() -> None:
    look = Within(grid(30))
    choice = choose_pairs(photos_at(look.enu) * np.nan, CONFIG, look)
    assert share_of_near(look.enu, choice.pairs) > 0.98
    assert len(choice.pairs) < 900 * 10
    assert look.ranked < 900 * 60 < len(exhaustive_pairs(900)) / 7


@pytest.mark.parametrize("wrong", ["swapped", "shuffled", "identical", "stuck", "shifted", "wild", "missing"])
def test_wrong_gps_loses_no_neighbours(wrong: str) -> None:
    enu = grid(12)
    photos, half = photos_at(enu), slice(len(enu) // 2, None)
    rng = np.random.default_rng(0)
    if wrong == "swapped":
        photos[["lat_deg", "lon_deg"]] = photos[["lon_deg", "lat_deg"]].to_numpy()
    elif wrong == "shuffled":
        photos[:] = photos.to_numpy()[rng.permutation(len(photos))]
    elif wrong == "identical":
        photos[:] = photos.to_numpy()[0]
    elif wrong == "stuck":
        photos.iloc[half] = photos.to_numpy()[0]
    elif wrong == "shifted":
        photos.loc[photos.index[half], "lat_deg"] += 1
    elif wrong == "wild":
        photos.loc[::5, "lat_deg"] += rng.normal(size=len(photos[::5]))
    else:
        photos.loc[::3] = np.nan
    choice = choose_pairs(photos, CONFIG, Within(enu))
    # Swapped axes stretch the map, but keep who is beside whom.
    assert share_of_near(enu, choice.pairs) > 0.95
    assert wrong == "swapped" or choice.by == "gps and coarse"
    assert len(choice.pairs) < len(exhaustive_pairs(len(photos))) / 3


def test_the_way_can_be_prescribed() -> None:
    enu = grid(12)
    photos, compare = photos_at(enu), Within(enu)
    ways = {
        way: choose_pairs(photos, MatchingConfig(pairs=way, neighbours=8), compare)
        for way in ("exhaustive", "gps", "coarse")
    }
    assert {way: choice.by for way, choice in ways.items()} == {way: way for way in ways}
    assert len(ways["exhaustive"].pairs) == 144 * 143 // 2


def test_gps_pairs_without_gps_are_refused() -> None:
    with pytest.raises(InputError, match=r"matching\.pairs=gps, but 0 of 144 photographs have GPS") as caught:
        choose_pairs(photos_at(grid(12)) * np.nan, MatchingConfig(pairs="gps"), NotAsked())
    assert "matching.pairs=auto" in caught.value.remedy


def test_gps_positions_are_metres_about_the_middle() -> None:
    enu, origin = gps_positions(photos_at(grid(5)))
    np.testing.assert_allclose(enu, grid(5) - [40, 40, 50], atol=0.01)
    assert origin[2] == pytest.approx(200, abs=0.01)


def test_a_missing_altitude_is_unknown_and_moves_the_position_little() -> None:
    photos = photos_at(grid(3))
    photos.loc[4, "alt_m"] = np.nan
    enu, _ = gps_positions(photos)
    assert np.flatnonzero(np.isnan(enu[:, 2])).tolist() == [4]
    np.testing.assert_allclose(enu[:, :2], grid(3)[:, :2] - 20, atol=0.01)


def test_without_any_altitude_there_are_still_positions() -> None:
    photos = photos_at(grid(3)).assign(alt_m=np.nan)
    enu, origin = gps_positions(photos)
    assert np.isnan(enu[:, 2]).all() and origin[2] == 0
    np.testing.assert_allclose(enu[:, :2], grid(3)[:, :2] - 20, atol=0.01)


def test_no_gps_is_nan() -> None:
    photos = photos_at(grid(3)) * np.nan
    enu, origin = gps_positions(photos)
    assert np.isnan(enu).all()
    assert np.isnan(origin).all()
