"""A scaffold seen from elsewhere: where the inputs' scaffolds are exact, so is it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aug3d_core.dataset import projection
from aug3d_core.dataset.new_views import with_scaffold, with_views
from aug3d_core.dataset.projection import ground_points, middle_ground, sampled_ground
from aug3d_core.dataset.scene import Scene
from tests.toy_scene import toy_scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return toy_scene(0, 48, 36)  # its scaffold is exact at every view


def test_a_view_sees_its_own_scaffold_again(scene: Scene) -> None:
    found = with_scaffold(scene, np.array([40]), np.array([40]))
    off = np.abs(found.scaffold[40].astype(float) - scene.scaffold[40])
    assert np.median(off) < 1e-2 * scene.scale and (found.scaffold[40] > 0).mean() > 0.98
    np.testing.assert_array_equal(np.delete(found.scaffold, 40, axis=0), np.delete(scene.scaffold, 40, axis=0))


def test_what_other_views_show_lies_where_it_is(scene: Scene) -> None:
    target, *inputs = scene.groups["test"][0]
    found = with_scaffold(scene, np.array([target]), np.array(inputs)).scaffold[target].astype(float)
    truth, known = scene.scaffold[target].astype(float), found > 0
    assert known.mean() > 0.5
    off = np.abs(found - truth)[known] / scene.scale
    assert np.median(off) < 0.005 and np.quantile(off, 0.9) < 0.15, "edges are a pixel wide"


def test_inputs_without_a_scaffold_give_none(scene: Scene) -> None:
    bare = replace(scene, scaffold=np.zeros_like(scene.scaffold))
    assert not with_scaffold(bare, np.array([40]), np.array([38, 41])).scaffold[:].any()


def tilted(scene: Scene, view: int, degrees: float) -> np.ndarray:
    """Return the pose of a view, turned from straight down towards the horizon."""
    turn, pose = np.radians(degrees), scene.world_from_cam[view].copy()
    ahead = np.array([0, np.sin(turn), -np.cos(turn)])
    pose[:3, :3] = np.stack([[1, 0, 0], np.cross(ahead, [1, 0, 0]), ahead], axis=1)
    return pose


def test_near_and_far_are_practically_the_same_from_a_grid_of_each_input(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    poses, inputs = np.stack([tilted(scene, 15, degrees) for degrees in (0, 20, 40, 60)]), np.arange(36)
    exact, rows = with_views(scene, poses, scene.intrinsics[15], inputs)
    monkeypatch.setattr(projection, "_SAMPLED", 36 * 48 * 36 // 16)
    sampled, _ = with_views(scene, poses, scene.intrinsics[15], inputs)
    off = np.abs(sampled.near_far[rows] - exact.near_far[rows]) / scene.scale
    assert off.max() < 0.01


def test_the_ground_of_a_few_views_is_that_of_all_their_pixels(scene: Scene) -> None:
    views = np.array([3, 8, 20])
    every = [points[reached] for points, reached in (ground_points(scene, int(view)) for view in views)]
    np.testing.assert_array_equal(sampled_ground(scene, views), np.concatenate(every))


@pytest.mark.parametrize("most", [100, 2000, 20_000])
def test_the_ground_of_many_views_is_some_of_each(scene: Scene, most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(projection, "_SAMPLED", most)
    views = np.arange(36)
    count = len(sampled_ground(scene, views))
    assert 36 * 64 <= count <= max(most, 36 * 200), "64 pixels of a view at least"
    assert len(sampled_ground(scene, views[:1])) <= max(most, 48 * 36)
    corners = np.array([sampled_ground(scene, views[[view]]).mean(axis=0) for view in views])
    assert np.linalg.norm(corners - [middle_ground(scene, view) for view in views], axis=1).max() < 0.2 * scene.scale
