"""The test block is one end of the ground, and training does not see it."""

from __future__ import annotations

import numpy as np
import pytest
from grouping.strip_scene import fly, scene_of
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

from aug3d_core.errors import InputError
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.grouping.audit import leak_shared_share
from aug3d_core.grouping.similarity import visibility
from aug3d_core.grouping.split import Role, Split, main_axis, shared_share_with, split_views


def split_of(flight: tuple[Views, Points, Tracks], test_share: float = 0.27, gap: float = 0.1) -> Split:
    views, points, tracks = flight
    visible = visibility(tracks, len(views), len(points.xyz))
    return split_views(scene_of(*flight).look_in_world, views.photo_id, visible, test_share, gap)


@given(st.integers(0, 2**31), st.floats(0.1, 0.5))
def test_every_view_has_one_role_and_the_block_its_size(seed: int, test_share: float) -> None:
    split = split_of(fly(seed=seed), test_share)
    assert sum(len(split.views(role)) for role in Role) == 40
    block = len(split.views(Role.SUPPORT, Role.TARGET))
    assert block == round(test_share * 40)
    assert len(split.views(Role.TARGET)) == len(range(1, block, 3))


@given(st.integers(0, 2**31))
def test_training_shares_at_most_the_gap_s_share_with_the_block(seed: int) -> None:
    flight = fly(seed=seed)
    split = split_of(flight)
    visible = visibility(flight[2], 40, 3000)
    block = np.isin(np.arange(40), split.views(Role.SUPPORT, Role.TARGET))
    share = shared_share_with(visible, block)
    assert split.gap_shared_share == 0.1
    assert (share[split.views(Role.TRAIN)] <= 0.1).all()
    assert (share[split.views(Role.GAP)] > 0.1).all()
    assert leak_shared_share(visible, split).max() <= 0.1


def test_the_block_is_one_end_of_the_ground() -> None:
    flight = fly()
    split, x = split_of(flight), scene_of(*flight).look_in_world[:, 0]
    block, others = split.views(Role.SUPPORT, Role.TARGET), split.views(Role.TRAIN, Role.GAP)
    assert x[block].min() >= x[others].max() or x[block].max() <= x[others].min()


def test_the_gap_is_about_a_footprint_wide() -> None:
    flight = fly()
    split, x = split_of(flight), scene_of(*flight).look_in_world[:, 0]
    between = np.abs(x[split.views(Role.TRAIN)][:, None] - x[split.views(Role.SUPPORT, Role.TARGET)]).min()
    assert 50 < between < 110  # a footprint is 80 m


def test_targets_are_every_third_of_the_block_in_capture_order() -> None:
    split = split_of(fly())
    block = split.views(Role.SUPPORT, Role.TARGET)  # photo ids grow with the index
    np.testing.assert_array_equal(block[1::3], split.views(Role.TARGET))


@given(st.integers(0, 2**31))
def test_the_order_of_views_does_not_matter(seed: int) -> None:
    views, points, tracks = fly(seed=seed)
    order = np.random.default_rng(seed).permutation(40)
    mixed = views.take(order), points, Tracks(tracks.point, np.argsort(order)[tracks.view], tracks.xy)
    np.testing.assert_array_equal(split_of(mixed).role, split_of((views, points, tracks)).role[order])


def test_where_all_overlap_the_gap_is_narrowed_and_says_so() -> None:
    split = split_of(fly(length_m=30.0))
    assert split.gap_shared_share > 0.1
    assert len(split.views(Role.TRAIN)) >= 14


def test_where_all_see_the_same_there_is_no_gap() -> None:
    look = np.random.default_rng(0).normal(size=(12, 2))
    split = split_views(look, np.arange(12), sparse.csr_array(np.ones((12, 50), np.int32)), 0.3, 0.1)
    assert split.gap_shared_share == 1.0
    assert len(split.views(Role.GAP)) == 0


def test_four_views_are_split() -> None:
    split = split_of(fly(4, length_m=60.0))
    assert len(split.views(Role.TARGET)) == 1
    assert len(split.views(Role.SUPPORT)) == 1
    assert len(split.views(Role.TRAIN)) == 2


def test_three_views_are_too_few() -> None:
    views, points, tracks = fly(4)
    keep = tracks.view < 3
    flight = views.take(np.arange(3)), points, Tracks(tracks.point[keep], tracks.view[keep], tracks.xy[keep])
    with pytest.raises(InputError, match="3 views are too few"):
        split_of(flight)


@given(st.floats(0, 2 * np.pi))
def test_the_main_axis_is_the_longest_and_has_no_sign(angle: float) -> None:
    direction = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-direction[1], direction[0]])
    steps = np.linspace(-1, 1, 21)
    positions = np.concatenate([steps[:, None] * direction * 10, steps[:, None] * across])
    assert abs(main_axis(positions) @ direction) == pytest.approx(1)
    np.testing.assert_allclose(main_axis(positions), main_axis(-positions))
