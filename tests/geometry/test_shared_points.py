"""Shared points are counted as by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.geometry.shared_points import components, look_positions, shared_points, visibility
from aug3d_core.geometry.views import Tracks


def some_tracks(seed: int, views: int, points: int, share: float = 0.3) -> tuple[Tracks, np.ndarray]:
    seen = np.random.default_rng(seed).random((views, points)) < share
    view, point = np.nonzero(seen)
    return Tracks(point, view, np.zeros((len(view), 2))), seen


@given(st.integers(0, 2**31), st.integers(1, 9), st.integers(1, 30), st.floats(0, 1))
def test_counts_are_those_of_sets(seed: int, views: int, points: int, share: float) -> None:
    tracks, seen = some_tracks(seed, views, points, share)
    shared = shared_points(visibility(tracks, views, points)).toarray()
    for i in range(views):
        for j in range(views):
            assert shared[i, j] == len(set(np.flatnonzero(seen[i])) & set(np.flatnonzero(seen[j])))


@given(st.integers(0, 2**31))
def test_symmetric_with_own_points_on_the_diagonal(seed: int) -> None:
    tracks, seen = some_tracks(seed, 8, 50)
    shared = shared_points(visibility(tracks, 8, 50)).toarray()
    np.testing.assert_array_equal(shared, shared.T)
    np.testing.assert_array_equal(np.diag(shared), seen.sum(axis=1))
    assert (shared <= np.diag(shared)[:, None]).all()


@given(st.integers(0, 2**31), st.randoms())
def test_the_order_of_observations_does_not_matter(seed: int, shuffler: np.random.Generator) -> None:
    tracks, _ = some_tracks(seed, 6, 40)
    order = np.random.default_rng(seed).permutation(len(tracks.view))
    mixed = Tracks(tracks.point[order], tracks.view[order], tracks.xy[order])
    one, two = (shared_points(visibility(t, 6, 40)) for t in (tracks, mixed))
    np.testing.assert_array_equal(one.data, two.data)
    np.testing.assert_array_equal(one.indices, two.indices)


def test_a_point_seen_twice_by_a_view_counts_once() -> None:
    tracks = Tracks(np.array([0, 0, 0]), np.array([0, 0, 1]), np.zeros((3, 2)))
    np.testing.assert_array_equal(shared_points(visibility(tracks, 2, 1)).toarray(), [[1, 1], [1, 1]])


def test_look_positions_are_means_and_nan_for_the_blind() -> None:
    tracks = Tracks(np.array([0, 1, 1]), np.array([0, 0, 2]), np.zeros((3, 2)))
    look, seen = look_positions(tracks, np.array([[2.0, 4.0, 9.0], [4.0, 8.0, 9.0]]), 3)
    np.testing.assert_array_equal(look, [[3, 6], [np.nan, np.nan], [4, 8]])
    np.testing.assert_array_equal(seen, [2, 0, 1])


@pytest.mark.parametrize(("least", "expected"), [(1, 2), (2, 3), (3, 4)])
def test_components_are_connected_by_enough_points(least: int, expected: int) -> None:
    # views 0 and 1 share two points, 1 and 2 one point, 3 shares nothing
    tracks = Tracks(np.array([0, 1, 0, 1, 2, 2, 3]), np.array([0, 0, 1, 1, 1, 2, 3]), np.zeros((7, 2)))
    assert len(set(components(shared_points(visibility(tracks, 4, 4)), least))) == expected
