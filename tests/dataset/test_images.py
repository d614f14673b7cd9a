import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.dataset.images import fit
from aug3d_core.geometry.transforms import project

SIZES = st.integers(min_value=8, max_value=400)


def test_an_image_of_the_packed_size_stays_as_it_is():
    rgb = np.random.default_rng(0).integers(0, 256, (7, 11, 3), dtype=np.uint8)
    same = fit(11, 7, 11, 7)
    assert np.array_equal(same.colour(rgb), rgb)
    assert np.array_equal(same.intrinsics(np.array([9.0, 8.0, 5.1, 3.2])), [9.0, 8.0, 5.1, 3.2])


def test_shrinking_averages_every_source_pixel_once():
    rgb = np.random.default_rng(1).integers(0, 256, (12, 20, 3), dtype=np.uint8)
    blocks = rgb.reshape(3, 4, 5, 4, 3).mean(axis=(1, 3))
    assert np.array_equal(fit(20, 12, 5, 3).colour(rgb), np.rint(blocks).astype(np.uint8))


@given(width=SIZES, height=SIZES)
def test_the_crop_is_the_largest_of_the_aspect_and_centred(width, height):
    left, top, right, bottom = fit(width, height, 8, 6).crop
    assert (right - left) / (bottom - top) == pytest.approx(8 / 6)
    assert min(left, top) == pytest.approx(0)
    assert (left + right, top + bottom) == pytest.approx((width, height))


@given(width=SIZES, height=SIZES)
def test_a_point_keeps_its_place_in_the_picture(width, height):
    crop = fit(width, height, 8, 6)
    source = np.array([300.0, 310.0, width * 0.45, height * 0.55])
    point = np.array([0.1, -0.2, 1.5])
    left, top, right, bottom = crop.crop
    share = (project(point, source) - [left, top]) / [right - left, bottom - top]
    assert project(point, crop.intrinsics(source)) == pytest.approx(share * [8, 6])


@pytest.mark.parametrize("factor", [1, 2, 4])
def test_a_pixel_is_the_mean_of_what_a_finer_view_shows_in_it(factor):
    rgb = np.random.default_rng(2).integers(0, 256, (50, 64, 3), dtype=np.uint8)
    crop = fit(64, 50, 8, 6)
    fine = crop.times(factor)
    parts = fine.colour(rgb).reshape(6, factor, 8, factor, 3).mean(axis=(1, 3))
    assert np.abs(parts - crop.colour(rgb)).max() <= 1
    source = np.array([50.0, 51.0, 30.0, 25.0])
    assert np.allclose(fine.intrinsics(source), factor * crop.intrinsics(source))


def test_content_stays_in_its_place_at_a_ratio_of_one_and_a_half():
    """The fine view of a photograph three times as wide as the packed one: a pixel is one of it and half of its neighbour."""
    ramp = np.tile((5 * np.arange(48, dtype=np.uint8))[None, :, None], (36, 1, 3))
    fine, depth = fit(48, 36, 16, 12).times(2), 1 + ramp[..., 0].astype(np.float32) / 5
    means = (3 * np.arange(16)[:, None] + [1 / 3, 5 / 3]).ravel()
    wanted = np.rint(5 * means).astype(np.uint8)[None, :, None]
    opaque = np.full(depth.shape, 255, np.uint8)
    colour, alpha, shrunk_depth = fine.covered(ramp, opaque, depth)
    for found in (fine.colour(ramp), colour, fine.masked(ramp, opaque > 0)):
        assert np.array_equal(found, np.broadcast_to(wanted, found.shape))
    assert (alpha == 255).all() and shrunk_depth == pytest.approx(np.tile(1 + means, (24, 1)), abs=1e-4)


@pytest.mark.parametrize("wide", [10, 15, 22, 44])
def test_depth_is_told_where_any_of_a_pixel_has_it_and_its_own(wide):
    """At 22 and 44 px rounding moves the edge of a pixel over the depth's by a hair: a hair of a depth is none."""
    nothing, depth = np.zeros((50, 50, 3), np.uint8), np.zeros((50, 50), np.float32)
    depth[:, 25:] = 5.0
    found = fit(50, 50, wide, wide).covered(nothing, nothing[..., 0], depth)[2]
    bare = (np.arange(wide) + 1) * 50 <= 25 * wide
    assert np.array_equal(found == 0, np.tile(bare, (wide, 1)))
    assert found == pytest.approx(np.tile(np.where(bare, 0.0, 5.0), (wide, 1)), abs=1e-4)


def test_holes_do_not_colour_what_is_covered():
    rgb = np.zeros((4, 4, 3), np.uint8)
    alpha, depth = np.zeros((4, 4), np.uint8), np.zeros((4, 4), np.float32)
    rgb[:, :2], alpha[:, :2], depth[:, :2] = 200, 255, 5.0
    rgb[:, 2:] = 13  # what lies under alpha 0 means nothing
    colour, cover, shrunk_depth = fit(4, 4, 1, 1).covered(rgb, alpha, depth)
    assert colour.tolist() == [[[200, 200, 200]]]
    assert cover.tolist() == [[128]]
    assert shrunk_depth == pytest.approx(5.0)


def test_values_that_must_not_be_mixed_are_not():
    values = np.random.default_rng(0).choice([0.0, 40.0, 50.0], (31, 43))
    crop = fit(43, 31, 12, 8)
    small = crop.nearest(values)
    assert small.shape == (8, 12) and set(np.unique(small)) <= {0.0, 40.0, 50.0}


def test_nothing_of_what_is_masked_is_left_in_a_packed_photograph():
    """Whatever stands there, the packed photograph is the same; and where nothing is masked, as without a mask."""
    rng = np.random.default_rng(0)
    rgb, crop = rng.integers(0, 256, (37, 50, 3), dtype=np.uint8), fit(50, 37, 11, 7)
    used = np.ones((37, 50), bool)
    used[9:30, 13:41] = False
    other = rgb.copy()
    other[~used] = rng.integers(0, 256, ((~used).sum(), 3), dtype=np.uint8)
    masked = crop.masked(rgb, used)
    np.testing.assert_array_equal(masked, crop.masked(other, used))
    assert not np.array_equal(crop.colour(rgb), crop.colour(other))
    np.testing.assert_array_equal(crop.masked(rgb, np.ones_like(used)), crop.colour(rgb))
    far = np.ones((7, 11), bool)
    far[1:7, 2:10] = False
    np.testing.assert_array_equal(masked[far], crop.colour(rgb)[far])


def test_a_size_that_rounding_makes_too_wide_is_packed():
    assert fit(50, 37, 11, 7).colour(np.full((37, 50, 3), 9, np.uint8)).tolist() == [[[9] * 3] * 11] * 7


def test_a_pixel_is_used_of_which_half_is_used():
    used = np.zeros((4, 8), bool)
    used[:, 0], used[:2, 2:4], used[0, 4:6] = True, True, True
    rgb = np.zeros((4, 8, 3), np.uint8)
    rgb[used] = 90
    crop = fit(8, 4, 4, 2)
    assert crop.alpha(used).tolist() == [[255, 255, 255, 0], [255, 0, 0, 0]]
    assert (crop.masked(rgb, used) == 90).all(), "a mean over what is used alone, and the nearest of those"
