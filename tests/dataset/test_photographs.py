"""Registered photographs alone are a scene to predict from: their size, cameras, ground and distance are right."""

import numpy as np
import pytest
from PIL import Image

from aug3d_core.dataset import real
from aug3d_core.dataset.photographs import scene_of_photographs
from aug3d_core.dataset.scene import SPLITS
from aug3d_core.geometry.masks import save_mask
from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.photos.files import image_name
from aug3d_core.run.errors import InputError
from aug3d_core.sfm.files import POINTS, TRACKS, VIEW_IMAGES, VIEW_MASKS, VIEWS


def flight(folder, count):
    """Write the poses of a flight at 30 m over ground of 3 m height, photograph 100 first."""
    (folder / VIEW_IMAGES).mkdir(parents=True)
    eyes = [np.array([4.0 * i, 0.0, 30.0]) for i in range(count)]
    poses = [look_at(eye, eye * [1, 1, 0] + [0, 1e-6, 0]) for eye in eyes] or np.zeros((0, 3, 4))
    intrinsics = np.tile([72.0, 72.0, 40.0, 30.0], (count, 1))
    Views(np.arange(count) + 100, np.array(poses), intrinsics, np.tile([80, 60], (count, 1))).save(folder / VIEWS)
    for number in range(count):
        Image.fromarray(np.full((60, 80, 3), 40 + number, np.uint8)).save(
            folder / VIEW_IMAGES / image_name(100 + number)
        )
    rng = np.random.default_rng(0)
    xyz = np.column_stack([rng.uniform(-15, 30, 200), rng.uniform(-12, 12, 200), rng.uniform(0, 3, 200)])
    Points(xyz, np.zeros((200, 3), np.uint8), np.ones(200)).save(folder / POINTS)
    point, view = np.tile(np.arange(200), count), np.repeat(np.arange(count), 200)
    Tracks(point, view, np.zeros((len(view), 2))).save(folder / TRACKS)
    return folder


def test_photographs_are_packed_with_their_cameras(tmp_path):
    scene = scene_of_photographs(flight(tmp_path, 5), (40, 32))
    assert scene.images.shape == (5, 32, 40, 3)
    assert scene.images[3].mean() == 43
    assert scene.fine_images.shape == (5, 64, 80, 3) and scene.fine_images[3].mean() == 43
    assert scene.photo_id.tolist() == [100, 101, 102, 103, 104]
    assert (scene.splits == SPLITS.index("support")).all()
    assert np.allclose(scene.world_from_cam[:, :3, 3], [[4 * i, 0, 30] for i in range(5)])
    assert np.allclose(scene.intrinsics[:, 2:], [20, 16])
    assert scene.scale == pytest.approx(30, rel=0.1)
    assert (scene.near_far[:, 0] < 27.5).all() and (scene.near_far[:, 1] > 29).all()


def test_what_is_masked_is_a_hole_and_its_colours_are_gone(tmp_path):
    folder = flight(tmp_path, 5)
    used = np.ones((60, 80), bool)
    used[:, 60:] = False
    save_mask(used, folder / VIEW_MASKS / image_name(102))
    pixels = np.full((60, 80, 3), 42, np.uint8)
    pixels[:, 60:] = 250
    Image.fromarray(pixels).save(folder / VIEW_IMAGES / image_name(102))
    scene = scene_of_photographs(folder, (40, 32))
    assert (scene.images[2] == 42).all() and (scene.fine_images[2] == 42).all()
    assert (scene.alpha[2] == 0).mean() == pytest.approx(0.23, abs=0.03)
    assert (scene.alpha[[0, 1, 3, 4]] == 255).all()


def test_photographs_are_read_when_they_are_asked_for_and_once(tmp_path, monkeypatch):
    """A place of thousands of photographs would fill the memory."""
    read, packed_colour = [], real.packed_colour

    def counted(sfm, photo_id, crop):
        read.append(photo_id)
        return packed_colour(sfm, photo_id, crop)

    monkeypatch.setattr(real, "packed_colour", counted)
    scene = scene_of_photographs(flight(tmp_path, 5), (40, 32))
    assert not read
    assert [scene.images[view].mean() for view in (3, 1, 3)] == [43, 41, 43]
    assert scene.fine_images[3].mean() == 43
    assert read == [103, 101, 103]


def test_all_photographs_of_which_masks_leave_nothing_are_named(tmp_path):
    folder = flight(tmp_path, 5)
    for number in (101, 103):
        save_mask(np.zeros((60, 80), bool), folder / VIEW_MASKS / image_name(number))
    with pytest.raises(InputError, match="masks leave nothing of 2 photos as they are packed, 40x32 px: 101, 103"):
        scene_of_photographs(folder, (40, 32))


def test_without_a_pose_there_is_no_scene(tmp_path):
    with pytest.raises(InputError, match="no photograph has a pose"):
        scene_of_photographs(flight(tmp_path, 0), (40, 32))


def test_a_photograph_of_the_sky_is_packed_like_the_others(tmp_path):
    folder = flight(tmp_path, 5)
    views, tracks = Views.load(folder / VIEWS), Tracks.load(folder / TRACKS)
    views.cam_from_world[2] = look_at(np.array([8.0, 0, 30]), np.array([8.0, 9, 99]))
    views.save(folder / VIEWS)
    seen = tracks.view != 2
    Tracks(tracks.point[seen], tracks.view[seen], tracks.xy[seen]).save(folder / TRACKS)
    near, far = scene_of_photographs(folder, (40, 32)).near_far.T
    assert ((near > 0) & (near < far) & np.isfinite(far)).all()


def test_photographs_that_look_past_the_ground_do_not_change_the_scale(tmp_path):
    folder = flight(tmp_path, 5)
    views = Views.load(folder / VIEWS)
    for view in (0, 2, 4):
        eye = np.array([4.0 * view, 0, 30])
        views.cam_from_world[view] = look_at(eye, eye + np.array([0, 1, 0.02]))
    views.save(folder / VIEWS)
    assert scene_of_photographs(folder, (40, 32)).scale == pytest.approx(30, rel=0.1)
