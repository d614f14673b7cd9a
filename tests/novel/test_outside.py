"""Photographs from outside become the same scene that the stage dataset would have packed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from aug3d_core.geometry.camera_models import world_from_gl
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import homogeneous, invert
from aug3d_core.novel.config import PredictionConfig
from aug3d_core.novel.outside import outside_scene, photo_names, photos_digest
from aug3d_core.novel.views import novel_view
from aug3d_core.run.errors import InputError
from tests.toy_scene import ALTITUDE_M, toy_scene

VIEWS = (8, 9, 14)


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, 24, 16)


@pytest.fixture
def given(scene, tmp_path):
    """Write three views of the toy as a nerfstudio folder."""
    (tmp_path / "images").mkdir()
    poses = homogeneous(world_from_gl(invert(scene.world_from_cam[list(VIEWS), :3])))
    frames = []
    for view, pose in zip(VIEWS, poses, strict=True):
        Image.fromarray(scene.images[view]).save(tmp_path / f"images/{view}.png")
        frames.append({"file_path": f"./images/{view}.png", "transform_matrix": pose.tolist()})
    fx, fy, cx, cy = scene.intrinsics[0].tolist()
    write(tmp_path, w=24, h=16, fl_x=fx, fl_y=fy, cx=cx, cy=cy, frames=frames)
    return tmp_path / "transforms.json"


def write(folder: Path, **whole: Any) -> None:
    (folder / "transforms.json").write_text(json.dumps(whole))


def changed(given: Path, **fields: Any) -> None:
    write(given.parent, **(json.loads(given.read_text()) | fields))


def test_they_are_the_views_that_were_given(scene, given):
    outside = outside_scene(given, scene)
    assert np.array_equal(outside.images, scene.images[list(VIEWS)])
    assert np.allclose(outside.world_from_cam, scene.world_from_cam[list(VIEWS)])
    assert np.allclose(outside.intrinsics, scene.intrinsics[list(VIEWS)])
    assert (outside.slab, outside.scale) == (scene.slab, scene.scale)
    near, far = outside.near_far.T
    assert ((near > 0) & (near < ALTITUDE_M - 10) & (far > ALTITUDE_M)).all()


def test_a_view_is_predicted_from_them_as_from_a_scene_s(scene, given):
    view = novel_view(outside_scene(given, scene), PredictionConfig())
    assert sorted(view.inputs) == [0, 1, 2]
    assert view.ground_seen_share > 0.5


def test_a_larger_photograph_is_shrunk_with_its_camera(scene, given):
    large = Image.fromarray(scene.images[VIEWS[0]]).resize((48, 32), Image.Resampling.NEAREST)
    large.save(given.parent / f"images/{VIEWS[0]}.png")
    outside = outside_scene(given, scene)
    assert np.array_equal(outside.images[0], scene.images[VIEWS[0]])
    assert np.array_equal(outside.fine_images[0], np.asarray(large))
    assert np.allclose(outside.intrinsics[0], scene.intrinsics[0])


def test_a_point_cloud_brings_its_own_ground(scene, given):
    xy = np.random.default_rng(0).uniform(-40, 40, (400, 2))
    points = np.column_stack([xy, np.where(np.arange(400) < 300, 2.0, 8.0)])
    Mesh(points, np.zeros((400, 3), np.uint8), np.zeros((0, 3), int)).save(given.parent / "points.ply")
    changed(given, ply_file_path="points.ply")
    outside = outside_scene(given, scene)
    assert outside.slab.height(np.array([0.0, 0.0, 2.0])) == pytest.approx(0, abs=0.2)
    assert outside.scale == pytest.approx(ALTITUDE_M, rel=0.15)


def test_names_and_digest_follow_what_is_there(given):
    assert photo_names(given)["name"].tolist() == [f"images/{view}.png" for view in VIEWS]
    before = photos_digest(given)
    Image.new("RGB", (24, 16)).save(given.parent / f"images/{VIEWS[1]}.png")
    assert photos_digest(given) != before


def test_a_missing_photograph_is_named(scene, given):
    (given.parent / f"images/{VIEWS[2]}.png").unlink()
    for function in (lambda: photos_digest(given), lambda: outside_scene(given, scene)):
        with pytest.raises(InputError, match=r"frame 2 .*14\.png does not exist"):
            function()


def test_a_distorted_photograph_is_refused(scene, given):
    changed(given, k1=0.1)
    with pytest.raises(InputError, match="distorted"):
        outside_scene(given, scene)


def test_a_photograph_of_another_shape_is_refused(scene, given):
    Image.new("RGB", (24, 20)).save(given.parent / f"images/{VIEWS[0]}.png")
    with pytest.raises(InputError, match="24x20 px, its camera is of 24x16"):
        outside_scene(given, scene)


def test_a_point_cloud_that_cannot_be_read_is_named(scene, given):
    changed(given, ply_file_path="points.ply")
    with pytest.raises(InputError, match=r"the point cloud points\.ply cannot be read"):
        outside_scene(given, scene)
