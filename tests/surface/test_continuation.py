import numpy as np

from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Views
from aug3d_core.surface.continuation import continue_ground, footprint, guessed, height_on, robust_plane
from aug3d_core.surface.evidence import Evidence

SLOPE = np.array([0.1, -0.05, 2.0])


def hovering(*places: tuple[float, float]) -> Views:
    """Cameras 30 above the origin's height that look straight down on 36 x 24 of the ground."""
    poses = np.stack([look_at(np.array([x, y, 32.0]), np.array([x, y, 0.0])) for x, y in places])
    n = len(poses)
    return Views(np.arange(n), poses, np.tile([50.0, 50.0, 30.0, 20.0], (n, 1)), np.tile([60, 40], (n, 1)))


def clump(half: float = 4.0) -> Evidence:
    """Points on a slope, in a square about the origin, half a unit apart."""
    xy = np.stack(np.meshgrid(*2 * [np.arange(-half, half + 0.1, 0.5)]), -1).reshape(-1, 2)
    return Evidence(np.column_stack([xy, height_on(SLOPE, xy)]), np.tile([0.0, 0.0, 1.0], (len(xy), 1)), 0.5)


def test_the_plane_does_not_follow_what_stands_on_it():
    rng = np.random.default_rng(0)
    xy = rng.uniform(-20, 20, (500, 2))
    z = height_on(SLOPE, xy) + rng.normal(0, 0.01, 500)
    z[:100] += rng.uniform(5, 30, 100)  # towers on one side
    np.testing.assert_allclose(robust_plane(np.column_stack([xy, z])), SLOPE, atol=0.05)


def test_the_slope_goes_on_where_a_photo_looks_and_nowhere_else():
    evidence, views = clump(), hovering((0.0, 0.0))
    more = continue_ground(evidence, views, reach=100.0)
    new = more.xyz[len(evidence.xyz) :]
    np.testing.assert_array_equal(more.xyz[: len(evidence.xyz)], evidence.xyz)
    np.testing.assert_allclose(new[:, 2], height_on(SLOPE, new[:, :2]), atol=1e-6)
    assert (np.abs(new[:, 0]) < 20).all()
    assert (np.abs(new[:, 1]) < 14).all()
    assert np.ptp(new[:, 0]) > 30
    assert (more.normals[len(evidence.xyz) :, 2] > 0.9).all()


def test_it_goes_no_further_than_its_reach_and_leaves_the_points_alone():
    evidence, views = clump(), hovering((0.0, 0.0))
    new = continue_ground(evidence, views, reach=3.0).xyz[len(evidence.xyz) :]
    beyond = np.abs(new[:, :2]).max(axis=1)
    assert len(new)
    assert beyond.max() <= 7.0 + 1e-9
    assert beyond.min() > 4.0
    assert len(continue_ground(evidence, views, reach=0.0).xyz) == len(evidence.xyz)


def test_the_footprint_is_the_shorter_side_of_what_a_photo_shows():
    assert np.isclose(footprint(clump(), hovering((0.0, 0.0), (3.0, 1.0))), 30 * 40 / 50, rtol=0.02)


def test_what_no_point_speaks_for_is_a_guess():
    assert guessed(np.array([[0.0, 0.0, 2.0], [30.0, 0.0, 5.0]]), clump()).tolist() == [False, True]
