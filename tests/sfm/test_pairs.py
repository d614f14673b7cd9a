"""The pairs compared are each photograph's neighbours, or all."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.geometry.geodesy import geodetic_from_enu
from aug3d_core.sfm.config import MatchingConfig
from aug3d_core.sfm.pairs import choose_pairs, exhaustive_pairs, gps_positions, neighbour_pairs


def photos_at(enu: np.ndarray) -> pd.DataFrame:
    geodetic = geodetic_from_enu(enu, np.array([52.2, 21.0, 150.0]))
    return pd.DataFrame(geodetic, columns=["lat_deg", "lon_deg", "alt_m"])


def grid(side: int, step_m: float = 20.0) -> np.ndarray:
    east, north = np.meshgrid(np.arange(side), np.arange(side))
    return np.stack([east.ravel(), north.ravel(), np.full(side * side, 2.5)], axis=1) * step_m


@given(st.integers(2, 70))
def test_exhaustive_pairs_are_all_pairs_once(count: int) -> None:
    pairs = exhaustive_pairs(count)
    assert (pairs[:, 0] < pairs[:, 1]).all()
    assert len(np.unique(pairs, axis=0)) == len(pairs) == count * (count - 1) // 2


def test_exhaustive_pairs_use_few_photographs_at_a_time() -> None:
    pairs = exhaustive_pairs(100)
    assert max(len(np.unique(pairs[start : start + 400])) for start in range(0, len(pairs), 400)) <= 80


@given(st.integers(3, 40), st.integers(2, 8), st.integers(0, 2**31))
def test_each_photograph_meets_its_nearest_and_its_next(count: int, neighbours: int, seed: int) -> None:
    positions = np.random.default_rng(seed).normal(size=(count, 2)) * 100
    pairs = {tuple(pair) for pair in neighbour_pairs(positions, neighbours)}
    assert all(i < j for i, j in pairs)
    for i in range(count):
        distance = np.linalg.norm(positions - positions[i], axis=1)
        for j in np.argsort(distance)[1 : neighbours + 1]:
            assert (min(i, j), max(i, j)) in pairs
    assert all((i, i + 1) in pairs for i in range(count - 1))


def test_a_photograph_without_a_position_meets_all() -> None:
    positions = grid(6)[:, :2]
    positions[7] = np.nan
    pairs = neighbour_pairs(positions, 4)
    assert (pairs == 7).any(axis=1).sum() == 35


def test_few_photographs_are_all_compared() -> None:
    pairs, chosen_by = choose_pairs(photos_at(grid(5)), MatchingConfig(exhaustive_limit=25))
    assert (len(pairs), chosen_by) == (300, "exhaustive")


def test_many_photographs_with_gps_are_compared_with_neighbours() -> None:
    pairs, chosen_by = choose_pairs(photos_at(grid(12)), MatchingConfig(exhaustive_limit=100, neighbours=8))
    assert chosen_by == "gps"
    assert len(pairs) < 144 * 10


def test_many_photographs_without_gps_are_all_compared() -> None:
    photos = photos_at(grid(12))
    photos.loc[10:] = np.nan
    pairs, chosen_by = choose_pairs(photos, MatchingConfig(exhaustive_limit=100))
    assert (len(pairs), chosen_by) == (144 * 143 // 2, "exhaustive")


def test_gps_positions_are_metres_about_the_middle() -> None:
    enu, origin = gps_positions(photos_at(grid(5)))
    np.testing.assert_allclose(enu, grid(5) - [40, 40, 50], atol=0.01)
    assert origin[2] == pytest.approx(200, abs=0.01)


def test_a_missing_altitude_counts_as_the_median_one() -> None:
    photos = photos_at(grid(3))
    photos.loc[4, "alt_m"] = np.nan
    enu, _ = gps_positions(photos)
    np.testing.assert_allclose(enu[:, 2], 0, atol=0.01)


def test_no_gps_is_nan() -> None:
    photos = photos_at(grid(3)) * np.nan
    enu, origin = gps_positions(photos)
    assert np.isnan(enu).all()
    assert np.isnan(origin).all()
