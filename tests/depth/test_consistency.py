from __future__ import annotations

import numpy as np

from aug3d_core.depth.cameras import Camera
from aug3d_core.depth.consistency import DepthMap, confirm
from aug3d_core.geometry.transforms import look_at


def ground_map(east: float, height: float = 40.0) -> DepthMap:
    """The exact depth map of level ground."""
    pose = look_at(np.array([east, 0.0, height]), np.array([east + 3.0, 2.0, 0.0]))
    camera = Camera(pose, np.array([100.0, 100.0, 64.0, 48.0]), 128, 96)
    depth = height / (camera.rays @ -pose[:, 2])
    return DepthMap(depth.astype(np.float32), camera)


def test_maps_of_the_same_ground_confirm_each_other_wherever_both_look() -> None:
    found = confirm(ground_map(0), [ground_map(5), ground_map(-8), ground_map(1000)])
    assert found.agreeing.max() == 2
    assert (found.agreeing == 2).mean() > 0.5
    np.testing.assert_allclose(found.depth, ground_map(0).depth, rtol=2e-3)


def test_a_wrong_depth_is_not_confirmed() -> None:
    wrong = ground_map(0)
    wrong.depth[40:50, 60:70] *= 0.9
    found = confirm(wrong, [ground_map(5)])
    assert not found.agreeing[40:50, 60:70].any()
    assert found.agreeing[30, 60] == 1


def test_holes_neither_confirm_nor_are_confirmed() -> None:
    holed, whole = ground_map(0), ground_map(5)
    holed.depth[:, :64] = 0
    assert not confirm(holed, [whole]).agreeing[:, :64].any()
    nothing = DepthMap(np.zeros_like(whole.depth), whole.camera)
    assert not confirm(ground_map(0), [nothing]).agreeing.any()
