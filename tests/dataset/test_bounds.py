import numpy as np

from aug3d_core.dataset.bounds import near_far
from aug3d_core.dataset.slab import Slab
from aug3d_core.geometry.transforms import homogeneous, invert, look_at

SLAB = Slab(0.0, 0.0, 0.0, 0.0, 10.0)
INTRINSICS = np.array([90.0, 90.0, 48.0, 36.0])


def bounds(eye: list[float], look: list[float], seen: list[float]) -> np.ndarray:
    pose = homogeneous(invert(look_at(np.array(eye, float), np.array(look, float))))
    return near_far(SLAB, pose, INTRINSICS, (96, 72), np.array(seen, float))


def test_looking_straight_down_the_bounds_are_the_slab():
    assert np.allclose(bounds([0, 0, 50], [0, 0, 0], [41, 49]), [40, 50])


def test_a_view_of_the_horizon_ends_beyond_what_it_is_known_to_see():
    near, far = bounds([0, 0, 20], [100, 0, 15], [30, 60, 200])
    assert 0 < near < 60
    assert 200 < far < 400
