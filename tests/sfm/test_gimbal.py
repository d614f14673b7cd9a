"""A flight that is bent is told by how its cameras roll and pitch, whichever way they head and whatever the pilot does."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from aug3d_core.geometry.transforms import centres, look_at
from aug3d_core.sfm.gimbal import doming_by_gimbal
from aug3d_core.town.config import FlightPath, TownConfig
from aug3d_core.town.drone.flight import plan_flight

EXTENT_M = float(np.hypot(140, 100))


def hung(tilt_deg: float = 0.0, shaken_deg: float = 0.0, seed: int = 0) -> np.ndarray:
    """Return poses of lines flown to and fro, the camera tilted ahead, each then shaken."""
    rng = np.random.default_rng(seed)
    poses = []
    for line, y in enumerate(np.linspace(-50, 50, 6)):
        ahead = np.array([1.0 if line % 2 == 0 else -1.0, 0, 0])
        down = np.sin(np.radians(tilt_deg)) * ahead - np.cos(np.radians(tilt_deg)) * np.array([0, 0, 1.0])
        right = np.cross(ahead, [0, 0, 1.0])
        for x in np.linspace(-70, 70, 9) * ahead[0]:
            shake = Rotation.from_rotvec(np.radians(shaken_deg) * rng.normal(size=3)).as_matrix()
            rotation = shake @ np.stack([right, np.cross(down, right), down])
            poses.append(np.column_stack([rotation, -rotation @ [x, y, 60.0]]))
    return np.stack(poses)


def bent(poses: np.ndarray, bowl_m: float) -> np.ndarray:
    """Return poses on a bowl of that height between the middle and the corners, each turned as the bowl is there."""
    moved = []
    for pose, at in zip(poses, centres(poses), strict=True):
        slope = 8 * bowl_m / EXTENT_M**2 * at[:2]
        turn = Rotation.from_rotvec([slope[1], -slope[0], 0]).as_matrix()
        rotation = pose[:, :3] @ turn.T
        raised = at + np.array([0, 0, 4 * bowl_m * (at[:2] ** 2).sum() / EXTENT_M**2])
        moved.append(np.column_stack([rotation, -rotation @ raised]))
    return np.stack(moved)


@given(st.floats(-2, 2), st.floats(0, 45), st.floats(0.01, 100), st.floats(-2, 2))
def test_the_bowl_is_found_in_any_unit_at_any_tilt_and_in_a_world_that_leans(
    bowl_m: float, tilt_deg: float, unit: float, lean_deg: float
) -> None:
    poses = bent(hung(tilt_deg, 0.1), bowl_m) @ np.block(
        [[Rotation.from_euler("x", lean_deg, degrees=True).as_matrix(), np.zeros((3, 1))], [np.zeros(3), 1.0]]
    )
    poses[:, :, 3] *= unit
    doming = doming_by_gimbal(poses)
    assert doming is not None
    assert doming.pct == pytest.approx(100 * bowl_m / EXTENT_M, rel=0.05, abs=0.05)


@pytest.mark.parametrize("tilt_deg", [0, 12, 40])
def test_shaken_cameras_bend_nothing_and_hide_no_bowl(tilt_deg: float) -> None:
    straight = [doming_by_gimbal(hung(tilt_deg, 1.0, seed)) for seed in range(100)]
    assert sum(one is None or one.sure for one in straight) <= 2
    bowl_m = 0.02 * EXTENT_M
    found = doming_by_gimbal(bent(hung(tilt_deg, 1.0), bowl_m))
    assert found is not None and found.flagged and abs(found.pct - 2) < 3 * found.sigma_pct
    assert any("bent like a bowl" in note and "as roll and pitch of the cameras tell" in note for note in found.notes)


@pytest.mark.parametrize("path", ["lawnmower", "nadir", "crossed", "oblique", "free", "abrupt", "orbit"])
def test_no_flight_of_the_virtual_drone_is_taken_for_bent(path: FlightPath) -> None:
    """Rings that look inwards from several heights pitch as if they were bent by 5 %, which roll does not tell."""
    told = [
        doming_by_gimbal(plan_flight(TownConfig(path=path, seed=seed), np.random.default_rng(seed)).cam_from_world)
        for seed in range(20)
    ]
    assert sum(one is not None and one.sure for one in told) <= 1
    assert path in ("orbit", "free") or any(told), "inwards, and by hand: told by none"


@pytest.mark.parametrize("deg", [2, 6])
def test_a_pilot_who_turns_the_camera_to_the_middle_bends_nothing(deg: float) -> None:
    """Flown sideways or ahead, pitched in proportion to the way that is left to the middle."""
    poses = hung(12, shaken_deg=0.3)
    for pose, at in zip(poses, centres(poses), strict=True):
        ahead = np.cross([0, 0, 1.0], pose[0, :3])
        turn = Rotation.from_rotvec(np.radians(deg) * (at @ ahead) / 70 * np.array([1, 0, 0])).as_matrix()
        pose[:, :3] = turn @ pose[:, :3]
        pose[:, 3] = -pose[:, :3] @ at
    told = doming_by_gimbal(poses)
    assert told is None or not told.sure


def test_cameras_that_tell_nothing() -> None:
    at = centres(hung())
    assert doming_by_gimbal(hung(shaken_deg=12.0)) is None, "turned by hand"
    assert doming_by_gimbal(np.stack([look_at(eye, np.zeros(3)) for eye in at + np.array([3.0, 2, 0])])) is None, (
        "to the middle"
    )
    assert doming_by_gimbal(hung()[:7]) is None, "too few"
    assert doming_by_gimbal(np.repeat(hung()[:1], 10, axis=0)) is None, "from one place"
