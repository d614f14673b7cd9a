"""Centres are spread over the ground."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.geometry.spread import evenly_spread, farthest_points


@given(st.integers(0, 2**31), st.integers(1, 40), st.integers(1, 50))
def test_centres_are_distinct(seed: int, positions: int, count: int) -> None:
    chosen = farthest_points(np.random.default_rng(seed).normal(size=(positions, 2)), count)
    assert len(set(chosen)) == len(chosen) == min(count, positions)


@given(st.integers(0, 2**31), st.integers(2, 12))
def test_centres_cover_the_ground_and_keep_apart(seed: int, count: int) -> None:
    """What farthest-point choice promises: nowhere is farther from a centre than two centres are apart."""
    positions = np.random.default_rng(seed).uniform(size=(60, 2))
    chosen = positions[farthest_points(positions, count)]
    apart = np.linalg.norm(chosen[:, None] - chosen[None], axis=2)[np.triu_indices(count, 1)].min()
    uncovered = np.linalg.norm(positions[:, None] - chosen[None], axis=2).min(axis=1).max()
    assert uncovered <= apart + 1e-12


def test_views_at_one_place_are_all_chosen() -> None:
    assert sorted(farthest_points(np.zeros((5, 2)), 5)) == [0, 1, 2, 3, 4]


@given(st.integers(1, 300), st.integers(1, 40))
def test_places_in_a_row_are_distinct_and_as_far_apart_as_each_other(count: int, most: int) -> None:
    chosen = evenly_spread(np.arange(count), most)
    assert chosen[0] == 0 and len(chosen) == min(count, most)
    if len(chosen) > 1:
        steps = np.diff(chosen)
        assert chosen[-1] == count - 1 and steps.min() > 0 and np.ptp(steps) <= 1
