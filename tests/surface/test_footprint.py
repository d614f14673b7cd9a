import numpy as np

from aug3d_core.surface.footprint import supported


def ring(hole: float) -> np.ndarray:
    """Points on a level net of spacing 1 over a square of side 60, without a round hole about the middle."""
    x, y = np.meshgrid(np.arange(61.0), np.arange(61.0))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    return points[np.linalg.norm(points[:, :2] - 30, axis=1) >= hole]


def test_a_small_hole_is_closed_and_a_wide_one_stays():
    middle = np.array([[30.0, 30.0, 0.0]])
    assert supported(middle, ring(3), 1.0, 10.0).all()
    assert not supported(middle, ring(15), 1.0, 10.0).any()


def test_nothing_grows_outwards_or_up():
    points = ring(0)
    beside = np.array([[-4.0, 30.0, 0.0], [64.0, 30.0, 0.0], [30.0, -200.0, 0.0]])
    above = np.array([[30.0, 30.0, 11.0], [30.0, 30.0, -11.0]])
    assert not supported(beside, points, 1.0, 10.0).any()
    assert not supported(above, points, 1.0, 10.0).any()


def test_every_point_supports_itself():
    points = ring(12)
    assert supported(points, points, 1.0, 10.0).all()
