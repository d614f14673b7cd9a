from __future__ import annotations

import numpy as np
import pytest

from aug3d_core.depth.cameras import Camera, relative_pose
from aug3d_core.depth.planes import horizontal_normal, make_family
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
