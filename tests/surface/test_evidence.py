import numpy as np
import pytest

from aug3d_core.geometry.fused import Fused
from aug3d_core.run.errors import InputError
from aug3d_core.surface.evidence import MIN_POINTS, gather


def net(side: int = 40, step: float = 0.5) -> Fused:
    """Points on a level net."""
    x, y = np.meshgrid(*2 * [np.arange(side) * step])
    xyz = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    return fused(xyz)


def fused(xyz: np.ndarray, normals: np.ndarray | None = None) -> Fused:
    up = np.tile([0.0, 0.0, 2.0], (len(xyz), 1)) if normals is None else normals
    n = len(xyz)
    return Fused(xyz.astype(np.float32), up.astype(np.float32), np.zeros((n, 3), np.uint8), np.full(n, 3, np.uint8))


def test_spacing_is_the_nets_and_normals_have_length_one():
    evidence = gather(net())
    assert np.isclose(evidence.spacing, 0.5)
    np.testing.assert_allclose(np.linalg.norm(evidence.normals, axis=1), 1)


def test_a_point_alone_in_the_air_is_left_out():
    points = net()
    xyz = points.xyz.copy()
    xyz[0] += (0, 0, 40)
    kept = gather(fused(xyz)).xyz
    assert kept[:, 2].max() == 0
    assert len(kept) > 0.95 * len(xyz)


def test_points_without_a_place_or_a_normal_are_left_out():
    points = net()
    xyz, normals = points.xyz.copy(), points.normals.copy()
    xyz[3], normals[7] = np.nan, 0
    assert len(gather(fused(xyz, normals)).xyz) <= len(xyz) - 2


@pytest.mark.parametrize("count", [0, 5, MIN_POINTS - 1])
def test_too_few_points_are_refused_with_their_number(count):
    points = net()
    few = Fused(points.xyz[:count], points.normals[:count], points.rgb[:count], points.views[:count])
    with pytest.raises(InputError, match=f"of {count} fused points"):
        gather(few)
