from __future__ import annotations

import numpy as np
import pytest

from aug3d_core.depth.ranges import depth_and_height_ranges
from aug3d_core.geometry.transforms import look_at


def one_view(heights: np.ndarray, camera_height: float) -> tuple[np.ndarray, np.ndarray]:
    """The pose of a view that looks straight down, and points of these heights."""
    count = len(heights)
    xyz = np.column_stack([np.linspace(-5, 5, count), np.zeros(count), heights])
    return look_at(np.array([0.0, 0.0, camera_height]), np.zeros(3)), xyz


def test_the_ranges_hold_all_points_with_some_room_and_no_stray() -> None:
    heights = np.append(np.linspace(0, 10, 999), 39.0)
    (nearest, farthest), (lowest, highest) = depth_and_height_ranges(*one_view(heights, 40.0))
    assert -3 < lowest < 0
    assert 10 < highest < 13
    assert 26 < nearest < 30
    assert 40 < farthest < 43


def test_level_ground_still_has_a_range() -> None:
    (nearest, farthest), (lowest, highest) = depth_and_height_ranges(*one_view(np.zeros(50), 40.0))
    assert nearest < 40 < farthest
    assert lowest < 0 < highest


@pytest.mark.parametrize("camera_height", [12.0, 15.0, 100.0])
def test_no_plane_lies_above_the_camera(camera_height: float) -> None:
    _, (_, highest) = depth_and_height_ranges(*one_view(np.linspace(0, 11.5, 500), camera_height))
    assert highest < camera_height
