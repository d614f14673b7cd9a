"""Groups hold the views that share most points with their centre."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.geometry.views import Tracks
from aug3d_core.groups.config import GroupingConfig
from aug3d_core.groups.methods.shared_points import group, most_shared
from tests.groups.strip_scene import fly, scene_of

RNG = np.random.default_rng(0)


@given(st.integers(0, 2**31), st.integers(2, 12), st.integers(1, 40))
def test_members_are_distinct_candidates_centre_first(seed: int, k: int, count: int) -> None:
    scene = scene_of(*fly(24, 400, seed=seed))
    candidates = np.sort(np.random.default_rng(seed).choice(24, 16, replace=False))
    members = group(scene, candidates, k, count, GroupingConfig(), RNG)
    assert len(members) <= min(count, 16)
    assert members.shape[1] == k
    assert np.isin(members, candidates).all()
    assert all(len(set(row)) == k for row in members)
    assert len(set(members[:, 0])) == len(members)


@given(st.integers(0, 2**31), st.integers(2, 10))
def test_no_view_left_out_shares_more_than_one_taken(seed: int, k: int) -> None:
    scene = scene_of(*fly(24, 400, seed=seed))
    shared = scene.shared_share.toarray()
    for row in group(scene, np.arange(24), k, 6, GroupingConfig(), RNG):
        out = np.setdiff1d(np.arange(24), row)
        assert shared[row[0], row[1:]].min() >= shared[row[0], out].max()
        assert (np.diff(shared[row[0], row[1:]]) <= 0).all()


@given(st.integers(0, 2**31))
def test_the_order_of_views_does_not_matter(seed: int) -> None:
    views, points, tracks = fly(24, 400, seed=seed)
    order = np.random.default_rng(seed).permutation(24)
    place = np.argsort(order)
    mixed = scene_of(views.take(order), points, Tracks(tracks.point, place[tracks.view], tracks.xy))
    scene = scene_of(views, points, tracks)
    for centre in range(24):
        expected = views.photo_id[most_shared(scene, centre, np.arange(24), 6)]
        np.testing.assert_array_equal(
            mixed.views.photo_id[most_shared(mixed, int(place[centre]), np.arange(24), 6)], expected
        )


def test_every_view_is_a_centre_when_there_are_groups_enough() -> None:
    members = group(scene_of(*fly(24, 400)), np.arange(24), 5, 100, GroupingConfig(), RNG)
    assert sorted(members[:, 0]) == list(range(24))


def test_views_of_the_same_ground_group_across_strips() -> None:
    """The two strips pass each other's ground long apart in time: capture order would not put them together."""
    scene = scene_of(*fly(40))
    members = most_shared(scene, 10, np.arange(40), 5)
    assert (members >= 20).any()
    x = scene.look_in_world[members, 0]
    assert np.ptp(x) < 80


@pytest.mark.parametrize("centre", [0, 7])
def test_views_that_share_nothing_come_last_and_nearest_first(centre: int) -> None:
    scene = scene_of(*fly(20, 500, length_m=1500.0))
    order = most_shared(scene, centre, np.arange(20), 20)
    nothing = order[1:][scene.shared.toarray()[centre, order[1:]] == 0]
    away = np.linalg.norm(scene.look_in_world[nothing] - scene.look_in_world[centre], axis=1)
    assert len(nothing) > 5
    assert (np.diff(away) >= -1e-9).all()
