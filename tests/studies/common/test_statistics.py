"""Intervals have the right width and contain the truth as often as they should."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from aug3d_core.studies.common.statistics import interval


@given(st.floats(-5, 5), st.integers(2, 4), st.integers(2, 8))
def test_a_difference_that_is_always_the_same_has_no_width(value: float, seeds: int, photos: int) -> None:
    low, high = interval(np.full((seeds, photos), value)) or (np.nan, np.nan)
    assert low == pytest.approx(value) and high == pytest.approx(value)


@given(st.floats(-3, 3), st.floats(0.5, 2))
def test_an_interval_moves_and_grows_with_what_it_is_of(shift: float, scale: float) -> None:
    values = np.random.default_rng(0).normal(size=(3, 5))
    low, high = interval(values) or (np.nan, np.nan)
    moved = interval(scale * values + shift)
    assert moved == pytest.approx((scale * low + shift, scale * high + shift))
    assert low <= values.mean() <= high


@pytest.mark.parametrize(
    ("seeds", "photos", "of_seeds", "of_photos"),
    [(3, 5, 0.3, 1.0), (3, 24, 0.3, 0.3), (3, 24, 0.5, 0.1), (2, 12, 0.0, 0.5)],
)
def test_few_photographs_or_seeds_are_no_excuse_for_a_narrow_interval(
    seeds: int, photos: int, of_seeds: float, of_photos: float
) -> None:
    """Of 400 samples 95 % should hold the truth; where seeds differ most, a bootstrap of both held 80 %."""
    rng, held = np.random.default_rng(1), 0
    for _ in range(400):
        values = 0.3 + of_photos * rng.normal(size=(1, photos)) + of_seeds * rng.normal(size=(seeds, 1))
        low, high = interval(values + 0.3 * rng.normal(size=(seeds, photos))) or (np.nan, np.nan)
        held += low <= 0.3 <= high
    assert held >= 364


def test_where_seeds_do_not_matter_it_is_the_interval_of_the_photographs() -> None:
    of_photos = np.random.default_rng(2).normal(size=8)
    low, high = interval(np.tile(of_photos, (3, 1))) or (np.nan, np.nan)
    assert (low, high) == pytest.approx(stats.t.interval(0.95, 7, of_photos.mean(), stats.sem(of_photos)))


def test_one_photograph_or_one_seed_has_no_interval() -> None:
    assert interval(np.ones((3, 1))) is None and interval(np.ones((1, 5))) is None
