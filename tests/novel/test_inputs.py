"""A view is predicted from photographs that together see most of it."""

from dataclasses import replace

import numpy as np
import pytest

from aug3d_core.dataset.projection import ground_points, shows
from aug3d_core.dataset.scene import Scene
from aug3d_core.geometry.transforms import look_at
from aug3d_core.novel.config import PredictionConfig
from aug3d_core.novel.inputs import inputs_of, most_alike
from aug3d_core.novel.views import novel_view
from tests.toy_scene import toy_scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return toy_scene(0, 48, 36)


def but(target: int) -> np.ndarray:
    return np.delete(np.arange(36), target)


def test_the_second_adds_to_what_the_first_shows_and_is_not_its_twin(scene: Scene) -> None:
    """Beside the photograph that shows most stands one like it, which adds next to nothing."""
    target = 15
    first, *others = most_alike(scene, target, but(target))
    poses = scene.world_from_cam.copy()
    poses[others[0]] = poses[first]
    poses[others[0], 0, 3] += 0.01
    twins = replace(scene, world_from_cam=poses)
    assert {*most_alike(twins, target, but(target))[:2]} == {first, others[0]}
    assert len({first, others[0]} & {*inputs_of(twins, target, but(target), 2)}) < 2
    assert len({first, others[0]} & {*novel_view(twins, PredictionConfig(like=target, input_views=2)).inputs}) < 2


def test_inputs_are_other_photographs_that_see_the_view(scene: Scene) -> None:
    for target in (2, 15, 30):
        chosen = inputs_of(scene, target, but(target), 4)
        assert len(set(chosen)) == 4 and target not in chosen
        assert (scene.photo_id[chosen] >= 0).all()
        ground, reached = ground_points(scene, target)
        seen = np.any([shows(scene, int(view), ground) for view in chosen], axis=0)[reached].mean()
        assert seen > 0.8


def test_ground_at_the_horizon_is_far_and_no_trouble(scene: Scene, recwarn: pytest.WarningsRecorder) -> None:
    poses = scene.world_from_cam.copy()
    half_px_down = 0.5 / scene.intrinsics[15, 1]  # one row of pixels sees the ground 10^5 heights away
    poses[15, :3, :3] = look_at(np.zeros(3), np.array([0.0, 1.0, half_px_down - 1e-5]))[:, :3].T
    chosen = inputs_of(replace(scene, world_from_cam=poses), 15, but(15), 4)
    assert len(set(chosen)) == 4 and not recwarn.list


def test_fewer_photographs_than_asked_for_are_all_inputs(scene: Scene) -> None:
    assert len(inputs_of(scene, 2, but(2), 99)) <= 24
