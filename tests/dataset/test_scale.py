"""How far the ground is from the photographs, where some or all of them look past it."""

from __future__ import annotations

import numpy as np
import pytest

from aug3d_core.dataset.scale import ground_distance
from aug3d_core.dataset.slab import Slab
from aug3d_core.geometry.transforms import homogeneous, invert, look_at


@pytest.mark.parametrize(("down", "level", "expected"), [(3, 0, 40.0), (2, 5, 40.0), (0, 3, 90.0)])
def test_photographs_that_show_no_ground_in_their_middle_do_not_count(down: int, level: int, expected: float) -> None:
    """From 20 m high, 30 degrees down: 40 m along z. Where none shows it, the far bounds tell."""
    eye = np.array([0.0, 0.0, 20.0])
    looks = [[0, np.sqrt(3), -1]] * down + [[0, 1, 0.02]] * level
    poses = np.array([homogeneous(invert(look_at(eye, eye + look))) for look in looks])
    count = len(poses)
    intrinsics, near_far = np.tile([36.0, 36.0, 20.0, 16.0], (count, 1)), np.tile([5.0, 90.0], (count, 1))
    slab = Slab(0.0, 0.0, 0.0, 0.0, 10.0)
    assert ground_distance(slab, poses, intrinsics, near_far, (40, 32)) == pytest.approx(expected)
