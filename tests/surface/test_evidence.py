import numpy as np

from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.surface.evidence import gather

CONFIG = SurfaceConfig()


def survey(count: int = 400, cameras: int = 5) -> tuple[Points, Tracks, Views]:
    """A gently sloping ground seen by all of a row of cameras."""
    rng = np.random.default_rng(0)
    xy = rng.uniform(-10, 10, (count, 2))
    xyz = np.column_stack([xy, 0.1 * xy[:, 0]])
    poses = np.stack([look_at(np.array([x, 0.5, 30.0]), np.array([x, 0.0, 0.0])) for x in np.linspace(-8, 8, cameras)])
    size = np.tile([64, 48], (cameras, 1))
    views = Views(np.arange(cameras), poses, np.tile([50.0, 50.0, 32.0, 24.0], (cameras, 1)), size)
    points = Points(xyz, np.full((count, 3), 128, np.uint8), np.full(count, 0.5))
    point, view = (grid.ravel() for grid in np.meshgrid(np.arange(count), np.arange(cameras)))
    return points, Tracks(point, view, np.zeros((len(point), 2))), views


def test_normals_are_the_slopes_and_look_at_the_cameras():
    points, tracks, views = survey()
    evidence = gather(points, tracks, views, np.ones(5, bool), CONFIG)
    truth = np.array([-0.1, 0, 1]) / np.hypot(0.1, 1)
    np.testing.assert_allclose(evidence.normals, np.tile(truth, (len(evidence.xyz), 1)), atol=1e-6)


def test_points_seen_by_one_allowed_view_are_not_used():
    points, tracks, views = survey()
    allowed = np.array([True, False, False, True, False])
    hidden = (tracks.point < 200) & (tracks.view == 3)
    fewer = Tracks(tracks.point[~hidden], tracks.view[~hidden], tracks.xy[~hidden])
    evidence = gather(points, fewer, views, allowed, CONFIG)
    assert {tuple(p) for p in evidence.xyz} <= {tuple(p) for p in points.xyz[200:]}
    assert gather(points, tracks, views, np.arange(5) == 0, CONFIG) is None


def test_bad_points_are_left_out():
    points, tracks, views = survey()
    xyz, error = points.xyz.copy(), points.error_px.copy()
    xyz[0] += (0, 0, 15)  # alone in the air
    error[1] = CONFIG.max_error_px * 1.01
    evidence = gather(Points(xyz, points.rgb, error), tracks, views, np.ones(5, bool), CONFIG)
    kept = {tuple(p) for p in evidence.xyz}
    assert tuple(xyz[0]) not in kept
    assert tuple(xyz[1]) not in kept
    assert len(kept) > 350


def test_points_without_parallax_are_left_out():
    points, tracks, views = survey()
    close = Views(views.photo_id, np.repeat(views.cam_from_world[:1], 5, axis=0), views.intrinsics, views.size)
    assert gather(points, tracks, close, np.ones(5, bool), CONFIG) is None


def test_order_of_observations_does_not_matter():
    points, tracks, views = survey()
    order = np.random.default_rng(1).permutation(len(tracks.point))
    shuffled = Tracks(tracks.point[order], tracks.view[order], tracks.xy[order])
    a = gather(points, tracks, views, np.ones(5, bool), CONFIG)
    b = gather(points, shuffled, views, np.ones(5, bool), CONFIG)
    np.testing.assert_array_equal(a.xyz, b.xyz)
    np.testing.assert_array_equal(a.normals, b.normals)
