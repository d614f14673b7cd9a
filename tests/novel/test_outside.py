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


def masked(given: Path, mask: Any, path: str = "masks/a.png") -> None:
    """Give the second photograph a mask: a path alone, or a picture there."""
    if isinstance(mask, Image.Image):
        (given.parent / path).parent.mkdir(exist_ok=True)
        mask.save(given.parent / path)
    frames = json.loads(given.read_text())["frames"]
    frames[1]["mask_path"] = path
    changed(given, frames=frames)


def cloud(given: Path, height: float) -> None:
    """Name a point cloud of ground at a height, with roofs above."""
    xy = np.random.default_rng(0).uniform(-40, 40, (400, 2))
    points = np.column_stack([xy, np.where(np.arange(400) < 300, height, height + 6)])
    Mesh(points, np.zeros((400, 3), np.uint8), np.zeros((0, 3), int)).save(given.parent / "points.ply")
    changed(given, ply_file_path="points.ply")


def hole() -> np.ndarray:
    used = np.ones((16, 24), bool)
    used[3:9, 5:20] = False
    return used


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
    cloud(given, 2.0)
    outside = outside_scene(given, scene)
    assert outside.slab.height(np.array([0.0, 0.0, 2.0])) == pytest.approx(0, abs=0.2)
    assert outside.scale == pytest.approx(ALTITUDE_M, rel=0.15)


def test_names_and_digest_follow_what_is_there(given):
    assert photo_names(given)["name"].tolist() == [f"images/{view}.png" for view in VIEWS]
    before = photos_digest(given)
    Image.new("RGB", (24, 16)).save(given.parent / f"images/{VIEWS[1]}.png")
    assert photos_digest(given) != before


def test_the_digest_follows_the_point_cloud_that_is_named(given):
    cloud(given, 0.0)
    before = photos_digest(given)
    cloud(given, 50.0)
    assert photos_digest(given) != before


def test_the_digest_follows_the_masks_that_are_named(given):
    masked(given, Image.new("L", (24, 16), 255))
    before = photos_digest(given)
    masked(given, Image.fromarray(hole()))
    assert photos_digest(given) != before


WHITE = Image.new("L", (24, 16), 255)
HOLES = {
    "grey": Image.fromarray(np.where(hole(), np.uint8(128), np.uint8(127))),
    "one bit": Image.fromarray(hole()),
    "colour": Image.fromarray(hole()).convert("RGB"),
    "16 bits": Image.fromarray(np.where(hole(), np.uint16(65535), np.uint16(0))),
    "transparent": Image.merge("LA", (WHITE, Image.fromarray(hole()).convert("L"))),
}


@pytest.mark.parametrize("mask", HOLES.values(), ids=HOLES)
def test_what_is_masked_is_a_hole_and_its_colours_are_gone(scene, given, mask):
    lorry = scene.images[VIEWS[1]].copy()
    lorry[~hole()] = (255, 0, 255)
    Image.fromarray(lorry).save(given.parent / f"images/{VIEWS[1]}.png")
    masked(given, mask)
    outside = outside_scene(given, scene)
    assert np.array_equal(outside.alpha[1] == 255, hole()) and np.array_equal(outside.alpha[1] == 0, ~hole())
    assert np.array_equal(outside.images[1][hole()], lorry[hole()])
    for pictures in (outside.images[1], outside.fine_images[1]):
        assert not (pictures == (255, 0, 255)).all(axis=-1).any()
    assert (outside.alpha[[0, 2]] == 255).all()
    assert np.array_equal(outside.images[[0, 2]], scene.images[[VIEWS[0], VIEWS[2]]])


@pytest.mark.parametrize(
    ("mask", "why"),
    [
        (Image.new("L", (12, 8), 255), r"masks/a\.png cannot be used \(it is 12x8 px, the photograph 24x16 px"),
        (Image.new("L", (24, 16), 127), r"masks/a\.png cannot be used \(it leaves nothing"),
        (None, r"masks/a\.png cannot be used \(.*No such file"),
    ],
)
def test_a_mask_that_does_not_fit_is_refused_by_its_name(scene, given, mask, why):
    masked(given, mask)
    with pytest.raises(InputError, match=f"frame 1 .*{why}"):
        outside_scene(given, scene)


@pytest.mark.parametrize("path", ["../a.png", "masks/../../a.png", "/a.png"])
def test_a_mask_outside_the_folder_is_refused_before_it_is_read(scene, given, path):
    masked(given, None, path)
    for function in (lambda: photos_digest(given), lambda: outside_scene(given, scene)):
        with pytest.raises(InputError, match=r"frame 1 .*a\.png cannot be used \(its path leads out"):
            function()


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
    for function in (lambda: photos_digest(given), lambda: outside_scene(given, scene)):
        with pytest.raises(InputError, match=r"the point cloud points\.ply cannot be read"):
            function()
