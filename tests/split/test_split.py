"""The test block is one piece of the ground, and training does not see it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from aug3d_core.geometry.footprint import footprints, footprints_apart
from aug3d_core.geometry.shared_points import visibility
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.groups.audit import leak_shared_share
from aug3d_core.groups.config import GroupingConfig
from aug3d_core.run.errors import InputError
from aug3d_core.split.split import (
    LEAST_TARGETS,
    MOST_NARROWED,
    Role,
    Split,
    main_axis,
    shared_share_with,
    split_views,
)
from tests.groups.strip_scene import fly, scene_of

Flight = tuple[Views, Points, Tracks]


def split_of(flight: Flight, **config: float) -> Split:
    views, points, tracks = flight
    visible = visibility(tracks, len(views), len(points.xyz))
    look = scene_of(*flight).look_in_world
    footprint = footprints(tracks, points.xyz, look)
    return split_views(look, footprint, views.photo_id, visible, GroupingConfig.model_validate(config))


def apart(flight: Flight, split: Split) -> np.ndarray:
    """Return how many footprints each view looks from the nearest of the test block."""
    look, views = scene_of(*flight).look_in_world, np.arange(len(flight[0]))
    block = split.views(Role.SUPPORT, Role.TARGET)
    return footprints_apart(look, footprints(flight[2], flight[1].xyz, look), views, block).min(axis=1)


def needed(flight: Flight, split: Split, footprints_asked: float = 1.0) -> np.ndarray:
    """Return how far the gap is to be narrowed for each view to be trained on: 0 not at all, 1 to nothing."""
    visible = visibility(flight[2], len(flight[0]), len(flight[1].xyz))
    block = np.isin(np.arange(len(flight[0])), split.views(Role.SUPPORT, Role.TARGET))
    nearer, shared = 1 - apart(flight, split) / footprints_asked, (shared_share_with(visible, block) - 0.1) / 0.9
    return np.maximum(nearer, shared).clip(0, 1)


def narrowed(flight: Flight, split: Split) -> float:
    """Return how far the gap was narrowed."""
    return needed(flight, split)[split.views(Role.TRAIN)].max()


@given(st.integers(0, 2**31), st.floats(0.1, 0.5))
def test_every_view_has_one_role_and_the_block_its_size(seed: int, test_share: float) -> None:
    split = split_of(fly(points=600, seed=seed), test_share=test_share, folds=1)
    assert sum(len(split.views(role)) for role in Role) == 40
    block = len(split.views(Role.SUPPORT, Role.TARGET))
    assert block == round(test_share * 40)
    assert len(split.views(Role.TARGET)) == len(range(1, block, 3))


@given(st.integers(0, 2**31))
def test_training_keeps_the_gap_in_ground_and_in_points(seed: int) -> None:
    flight = fly(points=600, seed=seed)
    split = split_of(flight)
    visible = visibility(flight[2], 40, 600)
    share = shared_share_with(visible, np.isin(np.arange(40), split.views(Role.SUPPORT, Role.TARGET)))
    train, gap = split.views(Role.TRAIN), split.views(Role.GAP)
    assert (share[train] <= 0.1).all() and (apart(flight, split)[train] >= 1).all()
    assert ((share[gap] > 0.1) | (apart(flight, split)[gap] < 1)).all()
    assert leak_shared_share(visible, split).max() <= 0.1


@settings(max_examples=15)
@given(st.floats(0.1, 3.0), st.integers(0, 2**31))
def test_a_gap_is_narrowed_no_more_than_it_has_to_be(footprints_asked: float, seed: int) -> None:
    flight = fly(points=600, seed=seed)
    split = split_of(flight, gap_footprints=footprints_asked)
    train, gap = split.views(Role.TRAIN), split.views(Role.GAP)
    far = needed(flight, split, footprints_asked)
    assert len(train) >= 14
    if len(gap):
        assert far[gap].min() > far[train].max()
        assert len(train) == 14 or far[train].max() == 0


@settings(max_examples=5)
@given(st.integers(0, 2**31))
def test_a_wider_gap_never_leaves_more_for_training(seed: int) -> None:
    left = [
        len(split_of(fly(points=600, seed=seed), gap_footprints=wide).views(Role.TRAIN))
        for wide in (0.2, 0.6, 1.0, 1.5)
    ]
    assert left == sorted(left, reverse=True)


def test_a_view_that_looks_far_off_but_shares_points_is_in_the_gap() -> None:
    look = np.array([[x, 0.0] for x in range(12)])
    visible = np.zeros((12, 120), np.int32)
    for view in range(12):
        visible[view, 10 * view : 10 * view + 10] = 1
    visible[5] = visible[0] + visible[11]  # oblique: it sees either end from afar
    split = split_views(look, np.full(12, 0.5), np.arange(12), sparse.csr_array(visible), GroupingConfig(folds=1))
    assert split.role[5] == Role.GAP
    assert len(split.views(Role.GAP)) == 1


def test_the_block_is_one_end_of_the_ground() -> None:
    flight = fly()
    split, x = split_of(flight), scene_of(*flight).look_in_world[:, 0]
    block, others = split.views(Role.SUPPORT, Role.TARGET), split.views(Role.TRAIN, Role.GAP)
    assert x[block].min() >= x[others].max() or x[block].max() <= x[others].min()


def test_the_gap_is_a_footprint_wide() -> None:
    flight = fly(120)  # a view every 7 m
    split, x = split_of(flight), scene_of(*flight).look_in_world[:, 0]
    between = np.abs(x[split.views(Role.TRAIN)][:, None] - x[split.views(Role.SUPPORT, Role.TARGET)]).min()
    assert 70 < between < 95  # a footprint is 80 m


def test_targets_are_every_third_of_the_block_in_capture_order() -> None:
    split = split_of(fly())
    block = split.views(Role.SUPPORT, Role.TARGET)  # photo ids grow with the index
    np.testing.assert_array_equal(block[1::3], split.views(Role.TARGET))


@given(st.integers(0, 2**31), st.sampled_from([1, 3]))
def test_the_order_of_views_does_not_matter(seed: int, folds: int) -> None:
    views, points, tracks = fly(points=600, seed=seed)
    order = np.random.default_rng(seed).permutation(40)
    mixed = views.take(order), points, Tracks(tracks.point, np.argsort(order)[tracks.view], tracks.xy)
    straight = split_of((views, points, tracks), folds=folds)
    np.testing.assert_array_equal(split_of(mixed, folds=folds).role, straight.role[order])


def test_where_all_overlap_the_gap_is_narrowed() -> None:
    flight = fly(length_m=30.0)
    split = split_of(flight)
    assert narrowed(flight, split) > 0.5
    assert len(split.views(Role.TRAIN)) >= 14


@pytest.mark.parametrize("spread", [1.0, 0.0])
def test_where_all_see_the_same_there_is_no_gap(spread: float) -> None:
    look = spread * np.random.default_rng(0).normal(size=(12, 2))
    visible = sparse.csr_array(np.ones((12, 50), np.int32))
    split = split_views(look, np.full(12, spread), np.arange(12), visible, GroupingConfig(test_share=0.3, folds=1))
    assert len(split.views(Role.GAP)) == 0


def test_four_views_are_split() -> None:
    split = split_of(fly(4, length_m=60.0))
    assert split.folds == 1
    assert len(split.views(Role.TARGET)) == 1
    assert len(split.views(Role.SUPPORT)) == 1
    assert len(split.views(Role.TRAIN)) == 2


def first(flight: Flight, count: int) -> Flight:
    views, points, tracks = flight
    keep = tracks.view < count
    return views.take(np.arange(count)), points, Tracks(tracks.point[keep], tracks.view[keep], tracks.xy[keep])


def test_three_views_are_too_few() -> None:
    with pytest.raises(InputError, match="3 views are too few"):
        split_of(first(fly(4), 3))


def all_folds(flight: Flight, **config: float) -> list[Split]:
    one = split_of(flight, **config)
    return [one, *(split_of(flight, **config, fold=fold) for fold in range(1, one.folds))]


@settings(max_examples=30)
@given(st.integers(5, 30), st.integers(0, 2**31))
def test_a_test_has_enough_photographs_that_training_does_not_see(pairs: int, seed: int) -> None:
    count = 2 * pairs
    flight = fly(count, points=600, seed=seed)
    splits = all_folds(flight)
    assert sum(len(split.views(Role.TARGET)) for split in splits) >= LEAST_TARGETS
    assert len(splits) == (1 if len(range(1, round(0.27 * count), 3)) >= LEAST_TARGETS else 2)
    for split in splits:
        assert narrowed(flight, split) <= MOST_NARROWED
        assert len(split.views(Role.TARGET)) >= 2 and len(split.views(Role.SUPPORT)) >= 3


def test_both_ends_are_tested_where_one_holds_few_photographs() -> None:
    flight = first(fly(60, points=600), 24)
    x = scene_of(*flight).look_in_world[:, 0]
    blocks = [split.views(Role.SUPPORT, Role.TARGET) for split in all_folds(flight)]
    order = np.argsort(x)
    assert sorted(map(set, map(np.ndarray.tolist, blocks)), key=max) == sorted(
        [set(order[:6].tolist()), set(order[-6:].tolist())], key=max
    )


def test_the_blocks_are_small_where_large_ones_would_be_seen() -> None:
    """Eighteen photographs that overlap a lot: blocks of eight at both ends leave half a gap, blocks of five more."""
    flight = fly(18, length_m=110.0, points=600)
    asked = split_of(flight, test_share=0.44, folds=1)
    splits = all_folds(flight, test_share=0.44)
    assert narrowed(flight, asked) > MOST_NARROWED
    assert [len(split.views(Role.SUPPORT, Role.TARGET)) for split in splits] == [5, 5]
    assert max(narrowed(flight, split) for split in splits) <= MOST_NARROWED


def test_without_a_sound_way_the_widest_gap_is_taken() -> None:
    flight = fly(16, length_m=60.0, points=600)
    widest = max(narrowed(flight, split) for split in all_folds(flight))
    assert widest > MOST_NARROWED
    assert widest <= max(narrowed(flight, split) for split in all_folds(flight, folds=4))


def test_a_few_photographs_have_one_end() -> None:
    assert split_of(first(fly(60, points=600), 9)).folds == 1


@settings(max_examples=10)
@given(st.integers(8, 40), st.integers(3, 4), st.integers(0, 2**31))
def test_folds_hold_out_every_view_once(count: int, folds: int, seed: int) -> None:
    flight = first(fly(40, points=600, seed=seed), count)
    splits = [split_of(flight, folds=folds, fold=fold) for fold in range(folds)]
    held_out = np.concatenate([split.views(Role.SUPPORT, Role.TARGET) for split in splits])
    np.testing.assert_array_equal(np.sort(held_out), np.arange(count))
    for split in splits:
        assert split.folds == folds
        assert len(split.views(Role.TRAIN)) >= 2 and len(split.views(Role.TARGET)) >= 1


def test_more_folds_than_the_views_allow_are_refused() -> None:
    with pytest.raises(InputError, match=r"8 views cannot be cut into grouping\.folds = 5: each needs 2"):
        split_of(first(fly(), 8), folds=5)


def test_a_fold_that_there_is_not_is_refused() -> None:
    with pytest.raises(InputError, match=r"no grouping\.fold 3: the scene has 1, counted from 0"):
        split_of(fly(), fold=3)


@given(st.floats(0, 2 * np.pi))
def test_the_main_axis_is_the_longest_and_has_no_sign(angle: float) -> None:
    direction = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-direction[1], direction[0]])
    steps = np.linspace(-1, 1, 21)
    positions = np.concatenate([steps[:, None] * direction * 10, steps[:, None] * across])
    assert abs(main_axis(positions) @ direction) == pytest.approx(1)
    np.testing.assert_allclose(main_axis(positions), main_axis(-positions))
