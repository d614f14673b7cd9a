"""Up is found from cameras and from the ground they look at."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.up_direction import fit_up, ground_height, rotation_to_z, up_from_cameras

SEEDS = st.integers(0, 2**31 - 1)


def aerial_cameras(rng: np.random.Generator, count: int = 12, oblique_m: float = 30.0) -> np.ndarray:
    """Return cameras 60 m up that look at random places on the ground."""
    at = np.concatenate([rng.uniform(-50, 50, size=(count, 2)), np.full((count, 1), 60.0)], axis=1)
    down = at * [1, 1, 0] + np.concatenate(
        [rng.uniform(-oblique_m, oblique_m, size=(count, 2)), np.zeros((count, 1))], 1
    )
    return np.stack([look_at(centre, target) for centre, target in zip(at, down, strict=True)])


def turned(cam_from_world: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return the cameras in a world turned by `rotation`."""
    return np.concatenate([cam_from_world[..., :3] @ rotation.T, cam_from_world[..., 3:]], axis=-1)


@given(SEEDS)
def test_rotation_to_z_turns_up_to_z(seed: int) -> None:
    up = np.random.default_rng(seed).normal(size=3)
    up /= np.linalg.norm(up)
    rotation = rotation_to_z(up)
    np.testing.assert_allclose(rotation @ up, [0, 0, 1], atol=1e-9)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(rotation) == pytest.approx(1)


def test_rotation_to_z_at_its_poles() -> None:
    np.testing.assert_allclose(rotation_to_z(np.array([0.0, 0.0, 1.0])), np.eye(3))
    np.testing.assert_allclose(rotation_to_z(np.array([0.0, 0.0, -1.0])) @ [0, 0, -1], [0, 0, 1])


@settings(max_examples=10, deadline=None)
@given(SEEDS)
def test_up_is_the_normal_of_the_ground_whatever_the_frame(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ground = np.concatenate([rng.uniform(-80, 80, size=(600, 2)), rng.normal(size=(600, 1)) * 0.2], axis=1)
    roofs = np.concatenate([rng.uniform(-80, 80, size=(300, 2)), rng.uniform(5, 20, size=(300, 1))], axis=1)
    world = Rotation.random(random_state=seed).as_matrix()
    cameras = turned(aerial_cameras(rng), world)
    up = fit_up(np.concatenate([ground, roofs]) @ world.T, up_from_cameras(cameras), 1.0, rng)
    assert np.degrees(np.arccos(np.clip(up @ world[:, 2], -1, 1))) < 1.0


def test_without_a_plane_the_cameras_decide() -> None:
    rng = np.random.default_rng(1)
    cameras = aerial_cameras(rng)
    cloud = rng.normal(size=(500, 3)) * 50
    np.testing.assert_allclose(fit_up(cloud, up_from_cameras(cameras), 0.1, rng), up_from_cameras(cameras))


def test_level_cameras_point_up() -> None:
    headings = np.radians(np.arange(0, 360, 30))
    targets = np.stack([np.cos(headings), np.sin(headings), np.zeros(12)], axis=1)
    cameras = np.stack([look_at(np.zeros(3), target) for target in targets])
    np.testing.assert_allclose(up_from_cameras(cameras), [0, 0, 1], atol=1e-9)


def test_a_facade_is_not_taken_for_the_ground() -> None:
    rng = np.random.default_rng(2)
    facade = np.concatenate(
        [np.full((900, 1), 40.0), rng.uniform(-30, 30, (900, 1)), rng.uniform(0, 20, (900, 1))], axis=1
    )
    ground = np.concatenate([rng.uniform(-60, 60, size=(400, 2)), np.zeros((400, 1))], axis=1)
    up = fit_up(np.concatenate([facade, ground]), up_from_cameras(aerial_cameras(rng, oblique_m=5.0)), 0.5, rng)
    np.testing.assert_allclose(up, [0, 0, 1], atol=0.02)


def test_ground_height_ignores_stray_points_below() -> None:
    rng = np.random.default_rng(3)
    heights = np.concatenate([rng.normal(0, 0.1, 700), rng.uniform(3, 20, 300), [-90.0, -50.0]])
    assert abs(ground_height(heights)) < 0.3
