"""Groups on exact depth: what two views share is counted with what hides it."""

import numpy as np

from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Views
from aug3d_core.town.exact.groups import grouped, net_points, shared

SIZE, FOCAL = (64, 48), 60.0


def views_at(*xs, up=30.0):
    """Return cameras at some x that look straight down on the plane z = 0, and their depth."""
    poses = np.stack([look_at(np.array([x, 0.0, up]), np.array([x, 1e-6, 0.0])) for x in xs])
    n = len(xs)
    intrinsics = np.tile([FOCAL, FOCAL, SIZE[0] / 2, SIZE[1] / 2], (n, 1))
    depth = np.full((n, SIZE[1], SIZE[0]), up, np.float16)
    return Views(np.arange(n), poses, intrinsics, np.tile(SIZE, (n, 1))), depth


def test_the_net_lies_on_what_is_seen():
    views, depth = views_at(0.0, 10.0)
    assert all(np.allclose(points[:, 2], 0, atol=1e-3) for points in net_points(views, depth))


def test_views_share_what_overlaps():
    across = SIZE[0] / FOCAL * 30.0  # of a footprint
    views, depth = views_at(0.0, across / 2, 2 * across)
    share = shared(views, depth)
    assert np.allclose(np.diag(share), 1)
    assert abs(share[0, 1] - 0.5) < 0.1
    assert share[0, 2] == 0


def test_what_is_hidden_is_not_shared():
    views, depth = views_at(0.0, 4.0)
    depth[1] = 12.0  # a roof over all that the second sees
    assert shared(views, depth)[0, 1] < 0.5


def test_a_group_is_its_view_and_the_nearest():
    views, depth = views_at(*np.arange(6) * 5.0)
    groups = grouped(views, depth, 3)
    assert groups[:, 0].tolist() == list(range(6))
    assert set(groups[0]) == {0, 1, 2}
    assert set(groups[3]) == {2, 3, 4}
