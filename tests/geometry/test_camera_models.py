"""Scaling keeps every ray; conventions come back to where they started; what is no camera or no pose is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from aug3d_core.geometry.camera_models import (
    Camera,
    cam_from_world,
    checked_camera,
    checked_pose,
    same_shape,
    scaled,
    world_from_gl,
)
from aug3d_core.geometry.transforms import apply, centres, forward
from aug3d_core.run.errors import InputError

poses = st.tuples(
    st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1),
    st.lists(st.floats(-1e4, 1e4), min_size=3, max_size=3),
).map(lambda qt: np.column_stack([Rotation.from_quat(qt[0]).as_matrix(), qt[1]]))
sides = st.integers(100, 6000)


def project(camera: Camera, x: float, y: float) -> np.ndarray:
    """Project the direction (x, y, 1) with OPENCV's or SIMPLE_RADIAL's distortion, from their definitions."""
    r2 = x * x + y * y
    if camera.model == "SIMPLE_RADIAL":
        focal, cx, cy, k = camera.params
        return np.array([focal * x * (1 + k * r2) + cx, focal * y * (1 + k * r2) + cy])
    fx, fy, cx, cy, k1, k2, p1, p2 = camera.params
    radial = 1 + k1 * r2 + k2 * r2 * r2
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + 2 * p2 * x * y + p1 * (r2 + 2 * y * y)
    return np.array([fx * u + cx, fy * v + cy])


@given(sides, sides, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.booleans())
def test_a_resized_image_sees_each_ray_at_the_resized_place(
    width: int, height: int, x: float, y: float, radial: bool
) -> None:
    camera = Camera("OPENCV", 4000, 3000, (3000.0, 3010.0, 2011.0, 1490.0, 0.1, -0.02, 1e-3, -2e-3))
    if radial:
        camera = Camera("SIMPLE_RADIAL", 4000, 3000, (3000.0, 2011.0, 1490.0, 0.1))
    small = scaled(camera, width, height)
    assert (small.width, small.height) == (width, height)
    np.testing.assert_allclose(
        project(small, x, y), project(camera, x, y) * [width / 4000, height / 3000], rtol=1e-9, atol=1e-9
    )


def test_a_model_with_one_focal_length_stays_where_both_axes_scale_alike() -> None:
    camera = Camera("SIMPLE_RADIAL", 4000, 3000, (3000.0, 2000.0, 1500.0, 0.1))
    assert scaled(camera, 1000, 750) == Camera("SIMPLE_RADIAL", 1000, 750, (750.0, 500.0, 375.0, 0.1))
    assert scaled(camera, 1000, 749).model == "OPENCV"


@given(st.integers(1000, 8000), st.integers(1000, 8000), st.integers(200, 999))
def test_any_resizing_to_whole_pixels_is_the_same_shape(width: int, height: int, longest: int) -> None:
    factor = longest / max(width, height)
    small = max(1, round(width * factor)), max(1, round(height * factor))
    assert same_shape(Camera("PINHOLE", width, height, (1.0, 1.0, 1.0, 1.0)), *small)


@pytest.mark.parametrize("size", [(3000, 4000), (3900, 3000), (4000, 2250)])
def test_turned_and_cropped_are_other_shapes(size: tuple[int, int]) -> None:
    assert not same_shape(Camera("PINHOLE", 4000, 3000, (1.0, 1.0, 1.0, 1.0)), *size)


@given(poses)
def test_there_and_back_is_the_same_pose(pose: np.ndarray) -> None:
    np.testing.assert_allclose(cam_from_world(world_from_gl(pose)), pose, atol=1e-9 * (1 + np.abs(pose).max()))


@given(poses)
def test_opengl_looks_along_minus_z_with_y_up_in_the_image(pose: np.ndarray) -> None:
    gl = world_from_gl(pose)
    np.testing.assert_allclose(gl[:, 3], centres(pose), atol=1e-8)
    np.testing.assert_allclose(-gl[:, 2], forward(pose), atol=1e-9)
    above = gl[:, 3] - 5 * gl[:, 2] + gl[:, 1]  # ahead, and one up
    np.testing.assert_allclose(apply(pose, above[None])[0], [0, -1, 5], atol=1e-6)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda m: m * np.array([np.nan, 1, 1, 1]), "not a finite number"),
        (lambda m: m * np.array([2.0, 2, 2, 1]), "not a rotation"),
        (lambda m: m * np.array([-1.0, 1, 1, 1]), "not a rotation"),
        (lambda m: m * 0, "not a rotation"),
    ],
)
def test_what_is_no_pose(spoil, words: str) -> None:
    with pytest.raises(InputError, match=rf"file, frame 3: .*{words}"):
        checked_pose(spoil(np.eye(3, 4)), "file, frame 3")


def test_a_rounded_rotation_is_made_exact() -> None:
    pose = np.column_stack([Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix(), [1, 2, 3]])
    checked = checked_pose(pose.astype(np.float32).astype(float), "file")
    np.testing.assert_allclose(checked[:, :3] @ checked[:, :3].T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(checked, pose, atol=1e-6)


@pytest.mark.parametrize(
    ("camera", "words"),
    [
        (Camera("EQUIRECTANGULAR", 4000, 2000, ()), "'EQUIRECTANGULAR' is not known"),
        (Camera("PINHOLE", 640, 480, (500.0, 320.0, 240.0)), "not 4 finite numbers"),
        (Camera("PINHOLE", 640, 480, (500.0, np.inf, 320.0, 240.0)), "not 4 finite numbers"),
        (Camera("PINHOLE", 640, 480, (-500.0, 500.0, 320.0, 240.0)), "-500 px cannot belong to an image of 640x480"),
        (Camera("PINHOLE", 640, 480, (1.2, 1.2, 0.5, 0.5)), "1.2 px cannot belong"),
        (Camera("PINHOLE", 0, 480, (500.0, 500.0, 320.0, 240.0)), "0x480"),
    ],
)
def test_what_is_no_camera(camera: Camera, words: str) -> None:
    with pytest.raises(InputError, match=words):
        checked_camera(camera, "file, camera 1")
