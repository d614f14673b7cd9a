"""Fused points keep what belongs together when some are taken."""

import numpy as np

from aug3d_core.geometry.fused import Fused


def cloud(count: int) -> Fused:
    rng = np.random.default_rng(0)
    xyz, normals = rng.normal(size=(2, count, 3)).astype(np.float32)
    return Fused(xyz, normals, rng.integers(0, 256, (count, 3), np.uint8), rng.integers(2, 9, count, np.uint8))


def test_points_are_taken_with_all_that_is_known_of_them() -> None:
    whole = cloud(9)
    rows = np.arange(9) % 3 == 1
    some = whole.take(rows)
    for name in ("xyz", "normals", "rgb", "views"):
        np.testing.assert_array_equal(getattr(some, name), getattr(whole, name)[rows])
