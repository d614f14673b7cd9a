"""The outline of a camera has its eye and its four corners, as deep as was asked for."""

from __future__ import annotations

import numpy as np

from aug3d_core.geometry.transforms import homogeneous, invert, look_at
from aug3d_core.view.layers import outlines


def test_it_looks_where_the_camera_looks() -> None:
    eyes = np.array([(3.0, 4.0, 20.0), (0.0, 0.0, 10.0)])
    poses = homogeneous(invert(np.stack([look_at(eye, eye * [1, 1, 0]) for eye in eyes])))
    intrinsics, size = np.array([(10.0, 10.0, 5.5, 3.5)] * 2), np.array([(11, 7)] * 2)
    lines = outlines(poses, intrinsics, size, 2.0).reshape(2, 8, 2, 3)
    assert np.allclose(lines[:, :4, 0], eyes[:, None])
    corners = lines[:, :4, 1]
    assert np.allclose(corners[..., 2], eyes[:, None, 2] - 2.0)
    assert np.allclose(np.ptp(corners, axis=1), [(2.2, 1.4, 0)] * 2)
    assert np.allclose(corners.mean(axis=1), eyes - [0, 0, 2.0])
    assert np.allclose(lines[:, 4:, 1], np.roll(corners, -1, axis=1))
