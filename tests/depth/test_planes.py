from __future__ import annotations

from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from aug3d_core.depth.cameras import Camera, relative_pose
from aug3d_core.depth.planes import _usual, horizontal_normal, make_family
from aug3d_core.geometry.transforms import look_at

STEP_PX = 2.0


def camera(east: float, height: float = 40.0, size: int = 1, tilt: float = 0.0) -> Camera:
    pose = look_at(np.array([east, 0.0, height]), np.array([east, tilt, 0.0]))
    return Camera(pose, np.array([100.0, 100.0, 64.0, 48.0]) * size, 128 * size, 96 * size)


def positions_px(reference: Camera, source: Camera, normal: np.ndarray, inverse: np.ndarray) -> np.ndarray:
    """Where the reference's middle pixel falls in the source, for each plane."""
    ray = reference.rays[reference.height // 2, reference.width // 2]
    rotation, translation = relative_pose(reference, source)
    there = (ray / (inverse * (ray @ normal))[:, None]) @ rotation.T + translation
    return there[:, :2] / there[:, 2:] * source.intrinsics[:2]


@pytest.mark.parametrize("size", [1, 4])
def test_adjacent_planes_move_a_source_pixel_by_at_most_the_bound(size: int) -> None:
    reference, source = camera(0, size=size), camera(15, size=size)
    family = make_family(reference, [source], horizontal_normal(reference), 20.0, 45.0, STEP_PX)
    shifts = np.linalg.norm(
        np.diff(positions_px(reference, source, family.normal, family.inverse_distance), axis=0), axis=1
    )
    assert shifts.max() <= STEP_PX + 1e-6
    assert shifts.max() > 0.8 * STEP_PX, "no more planes than the bound asks for"


def test_cameras_all_around_a_place_need_no_more_planes_than_pixels_can_tell_apart() -> None:
    """Near the source's own height a pixel races, but there the source does not show it any more."""
    reference, source = (
        Camera(look_at(np.array([x, -60.0, 40.0]), np.zeros(3)), np.array([300.0, 300.0, 192.0, 144.0]), 384, 288)
        for x in (-45.0, 45.0)
    )
    family = make_family(reference, [source], np.array([0.0, 0.0, 1.0]), 8.0, 300.0, STEP_PX)
    diagonal_px = np.hypot(384, 288)
    assert len(family.inverse_distance) < 2 * diagonal_px / STEP_PX
    rays = reference.rays[::24, ::24].reshape(-1, 3)
    rotation, translation = relative_pose(reference, source)
    there = (rays / family.inverse_distance[:, None, None]) @ rotation.T + translation
    at_px = there[..., :2] / there[..., 2:] * 300.0 + [192.0, 144.0]
    shown = (there[..., 2] > 0) & (at_px >= 0).all(axis=-1) & (at_px <= [384, 288]).all(axis=-1)
    moved = np.linalg.norm(np.diff(at_px, axis=0), axis=-1)[shown[1:] & shown[:-1]]
    assert len(moved) > 1000
    assert np.percentile(moved, 95) <= 1.1 * STEP_PX
    assert np.median(moved) > 0.3 * STEP_PX, "nor many more"


def test_what_no_source_shows_is_passed_in_a_few_planes() -> None:
    reference, behind = camera(0), camera(500)
    family = make_family(reference, [behind], horizontal_normal(reference), 20.0, 45.0, STEP_PX)
    assert len(family.inverse_distance) <= 4


def test_horizontal_planes_lie_level_however_the_camera_leans() -> None:
    reference = camera(0, tilt=20.0)
    family = make_family(reference, [camera(10, tilt=20.0)], horizontal_normal(reference), 30.0, 45.0, STEP_PX)
    distance = 1 / family.inverse_distance[0]
    depth = distance / (reference.rays @ family.normal)
    points = (reference.rays * depth[..., None] - reference.cam_from_world[:, 3]) @ reference.cam_from_world[:, :3]
    np.testing.assert_allclose(points[..., 2], 40.0 - distance, atol=1e-9)


def test_the_range_is_covered_from_end_to_end() -> None:
    reference = camera(0)
    family = make_family(reference, [camera(10)], np.array([0.0, 0.0, 1.0]), 30.0, 45.0, STEP_PX)
    np.testing.assert_allclose(1 / family.inverse_distance[[0, -1]], [45.0, 30.0])


@given(
    arrays(float, array_shapes(min_dims=2, max_dims=2, max_side=9), elements=st.floats(0, 50)),
    st.floats(0, 1),
    st.randoms(),
)
def test_what_usually_moves_is_the_percentile_of_what_counts(length: np.ndarray, share: float, random: Random) -> None:
    counts = np.array([[random.random() < share for _ in row] for row in length])
    numpys = [np.percentile(px[one], 90) if one.any() else 0.0 for px, one in zip(length, counts, strict=True)]
    np.testing.assert_array_equal(_usual(length, counts), numpys)
