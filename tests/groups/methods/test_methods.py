"""What every way of grouping keeps to, on flights good and bad."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Views
from aug3d_core.groups.config import GroupingConfig
from aug3d_core.groups.methods import EXCLUDED, METHODS
from aug3d_core.groups.scene import GroupingScene
from aug3d_core.run.errors import InputError
from tests.groups.strip_scene import fly, scene_of

CONFIG = GroupingConfig()
SCENE = scene_of(*fly(24, 1500))
every_way = pytest.mark.parametrize("method", METHODS)


def group(method: str, scene: GroupingScene, k: int, count: int, candidates: np.ndarray | None = None) -> np.ndarray:
    candidates = np.arange(len(scene.views)) if candidates is None else candidates
    return METHODS[method](scene, candidates, k, count, CONFIG, np.random.default_rng(0))


@every_way
@settings(max_examples=20)
@given(seed=st.integers(0, 2**31), k=st.integers(2, 12), count=st.integers(1, 40))
def test_members_are_distinct_candidates(method: str, seed: int, k: int, count: int) -> None:
    candidates = np.sort(np.random.default_rng(seed).choice(24, 16, replace=False))
    members = group(method, SCENE, k, count, candidates)
    assert members.shape[1] == k
    assert 1 <= len(members) <= count
    assert np.isin(members, candidates).all()
    assert all(len(set(row)) == k for row in members.tolist())


@every_way
def test_a_group_may_hold_every_view(method: str) -> None:
    assert set(group(method, SCENE, 24, 10)[0]) == set(range(24))


@every_way
def test_all_cameras_in_one_place_still_make_groups(method: str) -> None:
    views, points, tracks = fly(24, 1500)
    poses = np.repeat(views.cam_from_world[12:13], 24, axis=0)
    scene = scene_of(Views(views.photo_id, poses, views.intrinsics, views.size), points, tracks)
    members = group(method, scene, 5, 8)
    assert all(len(set(row)) == 5 for row in members.tolist())


@every_way
def test_the_same_scene_gives_the_same_groups(method: str) -> None:
    np.testing.assert_array_equal(group(method, SCENE, 5, 8), group(method, scene_of(*fly(24, 1500)), 5, 8))


@every_way
def test_no_way_asks_for_excluded_views_at_the_centre(method: str) -> None:
    if method in EXCLUDED:
        views = [view for part in EXCLUDED[method](SCENE, np.arange(24), 5).values() for view in part]
        assert not set(views) & set(group(method, SCENE, 5, 24)[:, 0])


def test_a_pose_that_is_not_finite_is_refused_by_the_photo() -> None:
    views, points, tracks = fly(24, 1500)
    views.cam_from_world[7, 0, 3] = np.nan
    with pytest.raises(InputError, match="the pose of photo 21 is not finite"):
        scene_of(views, points, tracks)


def test_runs_of_the_sequence_cover_the_capture_in_order() -> None:
    members = group("sequence", SCENE, 6, 10)
    assert [sorted(row) for row in members.tolist()] == [list(range(start, start + 6)) for start in (0, 6, 12, 18)]
    assert members[0, 0] == 3
    assert set(group("sequence", SCENE, 7, 10).ravel()) == set(range(24))


def test_cells_hold_the_nearest_cameras_wherever_they_look() -> None:
    """Neighbours that look apart: alone, the grid mixes them; with its angular constraint it does not."""
    at = np.column_stack([np.linspace(0, 115, 24), np.zeros(24), np.full(24, 40.0)])
    side = np.where(np.arange(24) % 2, 60.0, -60.0)
    poses = np.stack([look_at(a, np.array([a[0], s, 0.0])) for a, s in zip(at, side, strict=True)])
    views, points, tracks = fly(24, 1500)
    scene = scene_of(Views(views.photo_id, poses, views.intrinsics, views.size), points, tracks)
    mixed = [len(set(np.sign(side[row]))) for row in group("grid_any_angle", scene, 6, 4)]
    alike = [len(set(np.sign(side[row]))) for row in group("grid", scene, 6, 4)]
    assert set(mixed) == {2}
    assert set(alike) == {1}


def test_rays_end_on_the_ground_and_nearest_ends_group() -> None:
    """Two rows of cameras 80 apart look at one line between them: far from each other, they see the same."""
    at = [[x, side * 40.0, 40.0] for side in (-1, 1) for x in np.linspace(20, 380, 12)]
    poses = np.stack([look_at(np.array(a), np.array([a[0], 0.0, 0.0])) for a in at])
    views, points, tracks = fly(24, 1500)
    scene = scene_of(Views(views.photo_id, poses, views.intrinsics, views.size), points, tracks)
    for row in group("ray", scene, 2, 24):
        assert abs(row[0] - row[1]) == 12


def horizon_scene(level: int) -> GroupingScene:
    """Return the flight with some views that look level, over the ground."""
    views, points, tracks = fly(24, 1500)
    poses = views.cam_from_world.copy()
    poses[:level] = [look_at(np.array([x, 0.0, 30.0]), np.array([x, 50.0, 30.0])) for x in range(level)]
    return scene_of(Views(views.photo_id, poses, views.intrinsics, views.size), points, tracks)


def test_rays_at_the_horizon_are_left_out_and_told() -> None:
    scene = horizon_scene(5)
    assert not np.isin(group("ray", scene, 4, 24), np.arange(5)).any()
    (told,) = EXCLUDED["ray"](scene, np.arange(24), 4).values()
    np.testing.assert_array_equal(told, np.arange(5))


def test_too_few_rays_on_the_ground_are_refused() -> None:
    with pytest.raises(InputError, match="4 of 24 central rays meet the ground"):
        group("ray", horizon_scene(20), 5, 24)


def test_rays_without_a_ground_are_refused() -> None:
    views, points, _ = fly(24, 1500)
    tall = points.xyz * [0.05, 0.1, 0.0] + np.random.default_rng(0).uniform(0, [0, 0, 300], (1500, 3))
    scene = GroupingScene(views, SCENE.shared, SCENE.look_in_world, tall)
    with pytest.raises(InputError, match="no ground is to be found"):
        group("ray", scene, 5, 24)
