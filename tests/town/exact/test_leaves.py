"""Leaves are where crowns are, and look different in every photograph; nothing else does."""

import numpy as np
import pytest

from aug3d_core.town.exact.leaves import leaf_pixels, rustle
from tests.town.exact.test_groups import FOCAL, SIZE, views_at

UP_M, TOP_M, RADIUS_M = 30.0, 6.0, 4.0


def test_a_crown_is_where_it_is_seen_and_its_shadow_is_not():
    views, depth = views_at(0.0)
    depth[0, 10:20, 20:30] = UP_M - TOP_M
    row, column = 14.5, 24.5
    x, y = (column + 0.5 - SIZE[0] / 2) / FOCAL * (UP_M - TOP_M), (row + 0.5 - SIZE[1] / 2) / FOCAL * (UP_M - TOP_M)
    right, down = views.cam_from_world[0, :2, :3]
    crowns = np.array([[*(x * right + y * down)[:2], 5.0, RADIUS_M]])
    leaves = leaf_pixels(views, 0, depth[0], crowns)
    assert leaves[10:20, 20:30].all()
    on_ground = leaves.copy()
    on_ground[10:20, 20:30] = False
    assert leaf_pixels(views, 0, depth[0], crowns + np.array([0, 0, 20, 0])).sum() == 0  # a crown far above what is seen
    reach_px = 1.1 * RADIUS_M / UP_M * FOCAL
    far = np.hypot(*(np.indices(SIZE[::-1]) - np.array([row, column])[:, None, None])) > reach_px + 3
    assert not on_ground[far].any()


@pytest.mark.parametrize("count", [0, 1, 2, 9])
def test_any_number_of_crowns(count):
    views, depth = views_at(0.0)
    crowns = np.tile([0.0, 0.0, 0.0, 2.0], (count, 1))
    assert leaf_pixels(views, 0, depth[0], crowns).any() == (count > 0)


def test_the_sky_has_no_leaves():
    views, depth = views_at(0.0)
    depth[:, :20] = 0
    leaves = leaf_pixels(views, 0, depth[0], np.array([[0.0, 0.0, 0.0, 100.0]]))
    assert leaves[20:].all() and not leaves[:20].any()


@pytest.mark.parametrize("spread", [0.1, 0.5])
def test_leaves_move_alone_and_never_twice_alike(spread):
    image = np.full((60, 80, 3), (60, 90, 40), np.uint8)
    leaves = np.zeros((60, 80), bool)
    leaves[5:50] = True
    one, other = (rustle(image, leaves, spread, np.random.default_rng(seed)) for seed in (1, 2))
    np.testing.assert_array_equal(one[~leaves], image[~leaves])
    a, b = (np.log(each[leaves][:, 1].astype(float) / 90) for each in (one, other))
    assert a.std() == pytest.approx(spread, rel=0.15) and abs(np.corrcoef(a, b)[0, 1]) < 0.2


def test_leaves_that_do_not_differ_stay_as_they_are():
    image = np.random.default_rng(0).integers(0, 256, (20, 30, 3), dtype=np.uint8)
    np.testing.assert_array_equal(rustle(image, np.ones((20, 30), bool), 0.0, np.random.default_rng(0)), image)
