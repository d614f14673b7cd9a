"""What surface views see, from points alone: by rays that end where the scene's height says."""

from __future__ import annotations

import numpy as np
import pytest

from aug3d_core.geometry.ground_model import GroundModel
from aug3d_core.geometry.shared_points import share
from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Views
from aug3d_core.groups.surface_cells import seen_cells
from tests.groups.strip_scene import fly, scene_of

FLAT = GroundModel("level", np.zeros(3), None, np.array([[-100.0, -100.0], [100.0, 100.0]]), 0.1)


def ground(points: int = 20_000) -> np.ndarray:
    xy = np.random.default_rng(0).uniform(-100, 100, (points, 2))
    return np.column_stack([xy, np.zeros(points)])


def box(half: float = 15.0, height: float = 40.0, points: int = 8000) -> np.ndarray:
    """Return the roof and the walls of a house."""
    rng = np.random.default_rng(1)
    along, up, wall = rng.uniform(-half, half, points), rng.uniform(0, height, points), rng.integers(0, 5, points)
    x = np.choose(wall, [along, along, -half, half, along])
    y = np.choose(wall, [-half, half, along, along, rng.uniform(-half, half, points)])
    return np.column_stack([x, y, np.where(wall == 4, height, up)])


def views_at(*poses: tuple[tuple[float, float, float], tuple[float, float, float]]) -> Views:
    cam_from_world = np.stack([look_at(np.array(at), np.array(target)) for at, target in poses])
    count = len(poses)
    intrinsics = np.tile([100.0, 100.0, 60.0, 45.0], (count, 1))
    return Views(np.arange(count), cam_from_world, intrinsics, np.tile([120, 90], (count, 1)))


def alike(views: Views, points: np.ndarray, bare: GroundModel | None = FLAT) -> np.ndarray:
    seen = seen_cells(views, points, bare)
    return share((seen @ seen.T).tocsr()).toarray()


def nadir(x: float, y: float = 0.0) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    return (x, y, 50.0), (x, y, 0.0)


@pytest.mark.parametrize("moved", [0.0, 15.0, 30.0, 45.0, 75.0])
def test_over_flat_ground_similarity_is_the_share_of_the_footprint(moved: float) -> None:
    """A footprint is 60 wide: moved by d along it, two views have 1 - d / 60 in common."""
    assert alike(views_at(nadir(0), nadir(moved)), ground())[0, 1] == pytest.approx(max(0, 1 - moved / 60), abs=0.09)


def test_points_need_not_be_evenly_spread() -> None:
    """All texture is in one corner of the overlap: shared points would say that the views see the same."""
    points = ground()
    textured = points[(points[:, 0] > 20) | (np.random.default_rng(2).random(len(points)) < 0.02)]
    assert alike(views_at(nadir(0), nadir(30)), textured)[0, 1] == pytest.approx(0.5, abs=0.1)


def test_opposite_sides_of_a_tower_have_little_in_common() -> None:
    points = np.concatenate([ground()[(np.abs(ground()[:, :2]) > 15).any(axis=1)], box()])
    south, north = ((0.0, -60.0, 25.0), (0.0, 0.0, 15.0)), ((0.0, 60.0, 25.0), (0.0, 0.0, 15.0))
    assert alike(views_at(south, north), points)[0, 1] < 0.05
    assert alike(views_at(south, ((10.0, -60.0, 25.0), (0.0, 0.0, 15.0))), points)[0, 1] > 0.5


def test_a_tower_without_ground_is_seen_all_the_same() -> None:
    south, beside = ((0.0, -60.0, 25.0), (0.0, 0.0, 15.0)), ((10.0, -60.0, 25.0), (0.0, 0.0, 15.0))
    north = (0.0, 60.0, 25.0), (0.0, 0.0, 15.0)
    similarity = alike(views_at(south, beside, north), box(), None)
    assert similarity[0, 1] > 0.5
    assert similarity[0, 2] < 0.1


def test_views_of_the_sky_see_nothing() -> None:
    views = views_at(nadir(0), ((0.0, 0.0, 50.0), (0.0, 50.0, 150.0)))
    seen = seen_cells(views, ground(), FLAT).sum(axis=1)
    assert seen[0] > 50
    assert seen[1] == 0


def test_without_points_nothing_is_seen() -> None:
    assert seen_cells(views_at(nadir(0), nadir(9)), np.zeros((0, 3)), None).sum() == 0


def test_the_order_of_views_does_not_matter() -> None:
    scene = scene_of(*fly(24, 1500))
    order = np.random.default_rng(0).permutation(24)
    seen, mixed = (seen_cells(views, scene.points_in_world, FLAT) for views in (scene.views, scene.views.take(order)))
    np.testing.assert_allclose((seen @ seen.T).toarray()[order][:, order], (mixed @ mixed.T).toarray())
