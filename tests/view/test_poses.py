"""A pose goes to the browser and back unchanged, and a path goes through its key views."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from aug3d_core.geometry.transforms import homogeneous, invert, look_at
from aug3d_core.view.poses import fov_of, from_browser, intrinsics_of, through, to_browser

NUMBER = st.floats(-100, 100)
PLACE = st.tuples(NUMBER, NUMBER, NUMBER).map(np.array)
MIDDLE = np.array([5000.0, -3000.0, 20.0])


def pose(turn: np.ndarray, place: np.ndarray) -> np.ndarray:
    return homogeneous(np.column_stack([Rotation.from_rotvec(turn / 30).as_matrix(), place]))


@given(PLACE, PLACE)
def test_a_pose_comes_back(turn: np.ndarray, place: np.ndarray) -> None:
    there = pose(turn, place)
    assert np.allclose(from_browser(*to_browser(there, MIDDLE), MIDDLE), there)


def test_the_browser_has_the_same_axes() -> None:
    """viser's identity looks along z with y down, about the middle: so does the project's camera."""
    assert np.allclose(
        from_browser(np.array([1.0, 0, 0, 0]), np.zeros(3), MIDDLE)[:3], np.column_stack([np.eye(3), MIDDLE])
    )
    wxyz, position = to_browser(homogeneous(invert(look_at(MIDDLE + np.array([0, 0, 9.0]), MIDDLE))), MIDDLE)
    assert np.allclose(position, [0, 0, 9])
    assert np.allclose(abs(wxyz), [0, 1, 0, 0])  # straight down: half a turn about x


def test_a_field_of_view_comes_back() -> None:
    intrinsics = intrinsics_of(0.8, (11, 7))
    assert np.isclose(fov_of(intrinsics, 7), 0.8)
    assert np.allclose(intrinsics[2:], [5.5, 3.5])
    assert intrinsics[0] == intrinsics[1]


def test_a_path_goes_through_its_key_views_in_order() -> None:
    keys = np.stack([pose(np.array([0, 0, 5.0 * k]), np.array([10.0 * k, k * k, 40])) for k in range(4)])
    path = through(keys, 301, scale=40.0)
    nearest = [int(np.abs(path - key).sum(axis=(1, 2)).argmin()) for key in keys]
    assert nearest[0] == 0 and nearest[-1] == 300 and nearest == sorted(nearest)
    assert max(np.abs(path - key).sum(axis=(1, 2)).min() for key in keys) < 0.5
    steps = np.linalg.norm(np.diff(path[:, :3, 3], axis=0), axis=1)
    assert steps.max() < 3 * np.median(steps)
    assert np.allclose(path[:, :3, :3] @ np.swapaxes(path[:, :3, :3], 1, 2), np.eye(3))


def test_a_path_may_turn_on_the_spot() -> None:
    keys = np.stack([pose(np.array([0, 0, turn]), np.ones(3)) for turn in (0.0, 20.0, 20.0)])
    assert np.allclose(through(keys, 9, scale=1.0)[:, :3, 3], 1)
