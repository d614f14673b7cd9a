from dataclasses import replace

import numpy as np
import pytest

from aug3d_core.dataset.new_views import facing, only, with_views
from aug3d_core.dataset.projection import middle_ground
from aug3d_core.dataset.scene import REAL, check
from aug3d_core.novel.config import PredictionConfig
from aug3d_core.novel.views import novel_view
from aug3d_core.run.errors import InputError
from tests.toy_scene import ALTITUDE_M, toy_scene


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, 24, 16)


def test_left_alone_it_is_a_view_amid_photographs_of_the_middle(scene):
    view = novel_view(scene, PredictionConfig())
    assert len(view.inputs) == 3
    assert (scene.source[view.inputs] == REAL).all()
    eyes = scene.world_from_cam[view.inputs, :3, 3]
    assert np.allclose(view.scene.world_from_cam[view.target, :3, 3], eyes.mean(axis=0))
    middle = np.median([middle_ground(scene, v) for v in np.flatnonzero(scene.source == REAL)], axis=0)
    assert np.linalg.norm(middle_ground(view.scene, view.target) - middle) < 20
    assert view.ground_seen_share > 0.5


def test_the_view_is_one_more_row_that_the_scene_still_holds(scene):
    view = novel_view(scene, PredictionConfig())
    assert view.target == len(scene)
    check(view.scene, "scene")
    assert np.array_equal(view.scene.images[:-1], scene.images)


def test_like_a_photograph_means_its_camera_and_never_its_pixels(scene):
    view = novel_view(scene, PredictionConfig(like=8))
    assert np.array_equal(view.scene.world_from_cam[view.target], scene.world_from_cam[8])
    assert 8 not in view.inputs
    assert not view.scene.images[view.target].any()


def test_inputs_of_a_place_are_the_photographs_that_show_it(scene):
    view = novel_view(scene, PredictionConfig(at=(0.0, -5.0, 40.0), look_at=(0.0, 0.0, 0.0), input_views=4))
    assert np.allclose(middle_ground(view.scene, view.target), 0, atol=1e-9)
    spots = np.array([middle_ground(scene, v) for v in view.inputs])
    others = np.setdiff1d(np.flatnonzero(scene.source == REAL), view.inputs)
    assert (
        np.linalg.norm(spots, axis=1).mean()
        < np.linalg.norm([middle_ground(scene, v) for v in others], axis=1).mean() / 2
    )


@pytest.mark.parametrize("count", [1, 2, 5])
def test_named_photographs_are_taken_in_their_order(scene, count):
    ids = (14, 8, 13, 7, 15)[:count]
    view = novel_view(scene, PredictionConfig(inputs=ids))
    assert tuple(scene.photo_id[view.inputs]) == ids
    eye = view.scene.world_from_cam[view.target, :3, 3]
    assert np.linalg.norm(scene.world_from_cam[view.inputs, :3, 3] - eye, axis=1).min() > 0.1


@pytest.mark.parametrize("place", [(0.0, 0.0, -3.0), (0.0, 0.0, 0.0)])
def test_a_camera_under_the_ground_is_refused(scene, place):
    with pytest.raises(InputError, match="below the ground"):
        novel_view(scene, PredictionConfig(at=place, look_at=(9.0, 9.0, 5.0)))


def test_a_view_beyond_what_its_inputs_show_is_refused(scene):
    config = PredictionConfig(inputs=(0, 1, 6), at=(20.0, 20.0, ALTITUDE_M / 3), look_at=(25.0, 25.0, 0.0))
    with pytest.raises(InputError, match=r"shows no ground that its inputs show \(photos 0, 1, 6\)"):
        novel_view(scene, config)


def test_a_view_of_the_sky_is_refused_in_a_line(scene):
    with pytest.raises(InputError, match=r"its inputs show \(photos 0, 1, 2, 3, 4 and 31 more\)") as refused:
        novel_view(scene, PredictionConfig(at=(0.0, 0.0, 40.0), look_at=(0.0, 5.0, 90.0)))
    assert "if you named the inputs" in refused.value.remedy


@pytest.mark.parametrize("photo_id", [36, 1000])
def test_a_photograph_that_is_not_packed_is_named(scene, photo_id):
    with pytest.raises(InputError, match=f"photo {photo_id} is not in the packed scene"):
        novel_view(scene, PredictionConfig(inputs=(3, photo_id)))


def test_a_scene_of_one_photograph_cannot_be_seen_like_it(scene):
    alone = replace(scene, source=np.where(np.arange(len(scene)) == 4, REAL, 1 - REAL).astype(np.uint8))
    with pytest.raises(InputError, match="no photograph is left"):
        novel_view(alone, PredictionConfig(like=4))


def test_bounds_hold_the_ground_that_inputs_show(scene):
    like = 8
    poses = scene.world_from_cam[[like]]
    wider, (target,) = with_views(scene, poses, scene.intrinsics[like], np.array([7, 9]))
    near, far = wider.near_far[target]
    assert near < scene.near_far[like].mean() < far


def test_facing_keeps_the_top_of_the_picture_up():
    pose = facing(np.array([0.0, -10, 10]), np.zeros(3), np.array([0.0, 0, 1]))
    assert np.allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3))
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)
    assert np.allclose(pose[:3, 2], np.array([0, 1, -1]) / np.sqrt(2))
    assert -pose[2, 1] > 0.5  # the image's up is the world's up


def test_some_views_alone_are_a_scene(scene):
    few = only(scene, np.array([9, 4]))
    assert check(few, "few").photo_id.tolist() == [9, 4]
    assert np.array_equal(few.images, scene.images[[9, 4]])
