"""Rigid transforms are a group; cameras look where they are told to."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from aug3d_core.geometry import transforms

SEEDS = st.integers(0, 2**32 - 1)


def random_rigid(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Return rigid transforms of the given batch shape."""
    count = int(np.prod(shape, dtype=int))
    rotation = Rotation.random(count, random_state=int(rng.integers(2**31))).as_matrix().reshape(*shape, 3, 3)
    return np.concatenate([rotation, rng.normal(size=(*shape, 3, 1)) * 100], axis=-1)


@given(SEEDS)
def test_inverse_of_inverse_is_the_transform(seed: int) -> None:
    b_from_a = random_rigid(np.random.default_rng(seed), 4)
    np.testing.assert_allclose(transforms.invert(transforms.invert(b_from_a)), b_from_a, atol=1e-9)


@given(SEEDS)
def test_inverse_undoes_apply(seed: int) -> None:
    rng = np.random.default_rng(seed)
    b_from_a, points = random_rigid(rng, 3), rng.normal(size=(3, 7, 3))
    there = transforms.apply(b_from_a, points)
    np.testing.assert_allclose(transforms.apply(transforms.invert(b_from_a), there), points, atol=1e-9)


@given(SEEDS)
def test_apply_is_multiplication_by_the_homogeneous_matrix(seed: int) -> None:
    rng = np.random.default_rng(seed)
    b_from_a, points = random_rigid(rng), rng.normal(size=(7, 3))
    matrix = transforms.homogeneous(b_from_a)
    expected = (matrix @ np.concatenate([points, np.ones((7, 1))], axis=1).T).T
    np.testing.assert_allclose(transforms.apply(b_from_a, points), expected[:, :3], atol=1e-9)
    np.testing.assert_array_equal(expected[:, 3], 1)


@given(SEEDS)
def test_centre_is_the_origin_of_the_camera(seed: int) -> None:
    cam_from_world = random_rigid(np.random.default_rng(seed), 5)
    at = transforms.centres(cam_from_world)
    np.testing.assert_allclose(transforms.apply(cam_from_world, at[:, None])[:, 0], 0, atol=1e-9)


@given(SEEDS)
def test_a_point_straight_ahead_projects_to_the_principal_point(seed: int) -> None:
    cam_from_world = random_rigid(np.random.default_rng(seed))
    ahead = transforms.centres(cam_from_world) + 5 * transforms.forward(cam_from_world)
    in_cam = transforms.apply(cam_from_world, ahead[None])
    np.testing.assert_allclose(in_cam[0], [0, 0, 5], atol=1e-9)
    np.testing.assert_allclose(transforms.project(in_cam, np.array([90.0, 80.0, 5.5, 3.5])), [[5.5, 3.5]], atol=1e-9)


def test_projection_is_x_right_y_down() -> None:
    intrinsics = np.array([100.0, 200.0, 5.5, 3.5])
    points = np.array([[1.0, 0.0, 2.0], [0.0, 1.0, 2.0]])
    np.testing.assert_allclose(transforms.project(points, intrinsics), [[55.5, 3.5], [5.5, 103.5]])


@given(SEEDS)
def test_look_at_sees_its_target_ahead_with_the_horizon_level(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centre, target = rng.normal(size=3) * 10, rng.normal(size=3) * 10
    cam_from_world = transforms.look_at(centre, target)
    x, y, _ = cam_from_world[:, :3]
    in_cam = transforms.apply(cam_from_world, target[None])[0]
    np.testing.assert_allclose(in_cam, [0, 0, np.linalg.norm(target - centre)], atol=1e-9)
    np.testing.assert_allclose(transforms.centres(cam_from_world), centre, atol=1e-9)
    assert x[2] == pytest.approx(0, abs=1e-9)  # the image's rows are level
    assert y[2] <= 0  # and its bottom is down
    assert np.linalg.det(cam_from_world[:, :3]) == pytest.approx(1)


def test_looking_straight_down_the_top_of_the_image_is_north() -> None:
    cam_from_world = transforms.look_at(np.array([3.0, 4.0, 50.0]), np.array([3.0, 4.0, 0.0]))
    x, y, z = cam_from_world[:, :3]
    np.testing.assert_allclose([x, y, z], [[1, 0, 0], [0, -1, 0], [0, 0, -1]], atol=1e-12)
