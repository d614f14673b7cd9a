from __future__ import annotations

import numpy as np

from aug3d_core.depth.picture import depth_picture, normal_picture
from aug3d_core.geometry.transforms import look_at


def test_near_is_brighter_than_far_and_holes_are_grey() -> None:
    depth = np.array([[0.0, 10.0, 15.0, 20.0]], np.float32)
    picture = depth_picture(depth).astype(int)
    assert picture[0, 0].tolist() == [128, 128, 128]
    brightness = picture[0, 1:].sum(axis=-1)
    assert brightness[0] > brightness[1] > brightness[2]


def test_level_ground_is_blue_whatever_way_the_camera_turns() -> None:
    for east in (0.0, 7.0):
        pose = look_at(np.array([0.0, 0.0, 40.0]), np.array([east, 0.0, 0.0]))
        up = np.broadcast_to(pose[:, 2], (1, 1, 3)).astype(np.float32)
        np.testing.assert_allclose(normal_picture(up, pose)[0, 0].astype(int), [128, 128, 255], atol=1)


def test_an_empty_map_is_all_grey() -> None:
    assert (depth_picture(np.zeros((2, 3), np.float32)) == 128).all()
