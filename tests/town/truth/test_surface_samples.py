import numpy as np

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Views
from aug3d_core.town.truth.surface_samples import framed, sample_surface


def test_samples_are_spread_by_area():
    """A triangle of 1 and one of 3 square metres: a quarter of the points on the first, evenly within it."""
    xyz = np.array([(0, 0, 0), (2, 0, 0), (0, 1, 0), (10, 0, 5), (16, 0, 5), (10, 1, 5)], np.float32)
    mesh = Mesh(xyz, np.zeros((6, 3), np.uint8), np.array([(0, 1, 2), (3, 4, 5)], np.int32))
    points = sample_surface(mesh, 40_000, np.random.default_rng(0))
    first = points[points[:, 0] < 5]
    assert abs(len(first) / len(points) - 0.25) < 1e-3
    np.testing.assert_allclose(first.mean(axis=0), [2 / 3, 1 / 3, 0], atol=0.02)
    assert (first[:, 0] / 2 + first[:, 1] <= 1 + 1e-9).all() and first.min() >= 0


def test_an_empty_mesh_has_no_samples():
    nothing = Mesh(np.empty((0, 3), np.float32), np.empty((0, 3), np.uint8), np.empty((0, 3), np.int32))
    assert sample_surface(nothing, 100, np.random.default_rng(0)).shape == (0, 3)


def test_framed_is_in_front_and_inside():
    camera = look_at(np.array([0.0, 0.0, 10.0]), np.zeros(3))
    views = Views(np.array([0]), camera[None], np.array([[10.0, 10.0, 5.0, 4.0]]), np.array([[10, 8]]))
    points = np.array([(0, 0, 0), (4.9, 0, 0), (5.1, 0, 0), (0, 3.9, 0), (0, 4.1, 0), (0, 0, 20)], float)
    np.testing.assert_array_equal(framed(points, views, 0), [True, True, False, True, False, False])
