"""Layouts of other models, read back field by field; poses are checked by projecting points that are known."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
import torch
from PIL import Image
from scipy.spatial.transform import Rotation

from aug3d_core.dataset.images import fit
from aug3d_core.dataset.projection import ground_points, project
from aug3d_core.dataset.scene import SPLITS
from aug3d_core.export.packed import CHUNKS, EVALUATION_INDEX, PACKED_FORMATS, WAI, export_packed
from aug3d_core.poses.nerfstudio import read_transforms
from aug3d_core.run.errors import DiskFull, UsageError
from tests.export.full_disk import full_disk
from tests.toy_scene import toy_scene


@pytest.fixture(scope="module")
def scenes():
    return [("near", toy_scene(0, 48, 36), True), ("far", toy_scene(1, 48, 36), False)]


@pytest.fixture(scope="module")
def chunks(scenes, tmp_path_factory):
    folder = tmp_path_factory.mktemp("chunks") / "out"
    counts = export_packed(scenes, CHUNKS, folder)
    assert counts == {"train": 1 + 4, "test": 2 * len(scenes[0][1].groups["test"])}
    return folder


def examples(folder, part):
    index = json.loads((folder / part / "index.json").read_text())
    found = {}
    for file in sorted(set(index.values())):
        for one in torch.load(folder / part / file, weights_only=True):
            assert index[one["key"]] == file
            found[one["key"]] = one
    assert found.keys() == index.keys()
    return found


def test_chunks_have_the_fields_that_loaders_read(chunks, scenes):
    for part in ("train", "test"):
        for one in examples(chunks, part).values():
            views = len(one["images"])
            assert one["cameras"].shape == (views, 18) and one["cameras"].dtype == torch.float32
            assert one["timestamps"].shape == (views,) and one["timestamps"].dtype == torch.int64
            assert (one["timestamps"].diff() > 0).all()
            assert all(image.dtype == torch.uint8 and image.dim() == 1 for image in one["images"])
    scene = scenes[0][1]
    near = examples(chunks, "train")["near"]
    rows = np.flatnonzero((scene.splits == SPLITS.index("train")) & (scene.dome_id < 0))
    shown = [np.asarray(Image.open(io.BytesIO(image.numpy().tobytes()))) for image in near["images"]]
    assert np.array_equal(np.stack(shown), scene.images[rows])


def test_points_are_where_a_chunk_s_cameras_say(chunks, scenes):
    scene = scenes[0][1]
    rows = np.flatnonzero((scene.splits == SPLITS.index("train")) & (scene.dome_id < 0))
    points, reached = ground_points(scene, int(rows[0]))
    points = points[reached][::50]
    for camera, view in zip(examples(chunks, "train")["near"]["cameras"].double().numpy(), rows, strict=True):
        in_cam = np.column_stack([points, np.ones(len(points))]) @ camera[6:].reshape(3, 4).T
        share = in_cam[:, :2] / in_cam[:, 2:] * camera[:2] + camera[2:4]
        there, ahead = project(scene, int(view), points)
        assert np.allclose(share[ahead] * [48, 36], there[ahead], atol=1e-2)


def test_the_held_out_targets_are_named_and_never_trained_on(chunks, scenes):
    index = json.loads((chunks / EVALUATION_INDEX).read_text())
    tests = examples(chunks, "test")
    assert index.keys() == tests.keys()
    for name, scene, _ in scenes:
        for number, members in enumerate(scene.groups["test"]):
            told = index[f"{name}-test-{number:05d}"]
            rows = np.sort(members)
            assert rows[told["target"]].tolist() == [members[0]]
            assert sorted(rows[told["context"]]) == sorted(members[1:])
    train = examples(chunks, "train")
    assert not any(key.startswith("far") for key in train), "a scene that is held out"


def test_wai_keeps_poses_depth_and_masks(scenes, tmp_path):
    export_packed(scenes[:1], WAI, tmp_path / "out")
    scene = scenes[0][1]
    folder = tmp_path / "out" / "train" / "near-dome-00000"
    meta = json.loads((folder / "scene_meta.json").read_text())
    assert meta["camera_convention"] == "opencv" and meta["frame_modalities"]["depth"]["format"] == "depth"
    rows = np.flatnonzero(scene.dome_id == 0)
    for frame, view in zip(meta["frames"], rows, strict=True):
        assert np.allclose(frame["transform_matrix"], scene.world_from_cam[view])
        assert np.allclose([frame[name] for name in ("fl_x", "fl_y", "cx", "cy")], scene.intrinsics[view])
        with Image.open(folder / frame["image"]) as image:
            assert np.array_equal(np.asarray(image), scene.images[view])
        with OpenEXR.File(str(folder / frame["depth"])) as file:
            assert np.allclose(file.channels()["Y"].pixels, scene.depth[view], rtol=1e-3)


def read_back(form, folder):
    """Return (width, height), intrinsics and cam_from_world of every view. What pycolmap reads is tested for scenes."""
    if form == "nerfstudio":
        entries = read_transforms(folder / "transforms.json")
        cameras = [entry.names[0][1] for entry in entries]
        return [
            ((camera.width, camera.height), camera.params[:4], entry.cam_from_world)
            for camera, entry in zip(cameras, entries, strict=True)
        ]
    lines = {
        name: [
            line.split() for line in (folder / "sparse/0" / name).read_text().splitlines() if line and line[0] != "#"
        ]
        for name in ("cameras.txt", "images.txt", "points3D.txt")
    }
    assert lines["points3D.txt"] == []
    cameras = {number: ((int(w), int(h)), tuple(map(float, rest))) for number, _, w, h, *rest in lines["cameras.txt"]}
    found = []
    for _, w, x, y, z, *shift, camera, name in lines["images.txt"]:
        assert (folder / "images" / name).is_file()
        turn = Rotation.from_quat([float(v) for v in (x, y, z, w)]).as_matrix()
        found.append((*cameras[camera], np.column_stack([turn, [float(v) for v in shift]])))
    return found


@pytest.mark.parametrize("size", [None, (32, 36), (24, 18)])
@pytest.mark.parametrize("form", ["nerfstudio", "colmap"])
def test_points_are_where_the_cameras_of_a_folder_say(scenes, tmp_path, form, size):
    export_packed(scenes[:1], form, tmp_path / "out", size)
    scene, folder = scenes[0][1], tmp_path / "out" / "train" / "near-dome-00000"
    rows = np.flatnonzero(scene.dome_id == 0)
    points, reached = ground_points(scene, int(rows[0]))
    points = np.column_stack([points[reached][::50], np.ones(len(points[reached][::50]))])
    crop = fit(48, 36, *(size or (48, 36)))
    for ((width, height), (fx, fy, cx, cy), pose), view in zip(read_back(form, folder), rows, strict=True):
        assert (width, height) == (size or (48, 36))
        in_cam = points @ pose.T
        there = in_cam[:, :2] / in_cam[:, 2:] * [fx, fy] + [cx, cy]
        packed, ahead = project(scene, int(view), points[:, :3])
        left, top, right, bottom = crop.crop
        wanted = (packed - [left, top]) * [width / (right - left), height / (bottom - top)]
        assert np.allclose(there[ahead], wanted, atol=1e-3)
    with Image.open(folder / "images" / "000000.png") as image:
        assert np.array_equal(
            np.asarray(image),
            crop.covered(scene.images[rows[0]], scene.alpha[rows[0]], scene.depth[rows[0]].astype(np.float32))[0],
        )


def test_nerfstudio_s_depth_has_one_unit_which_a_file_tells(scenes, tmp_path):
    name, scene, trained = scenes[0]
    deep = replace(scene, depth=scene.depth * np.float16(20))
    export_packed([(name, scene, trained), ("deep", deep, True)], "nerfstudio", tmp_path / "out")
    told = [json.loads(file.read_text()) for file in sorted((tmp_path / "out").rglob("transforms.json"))]
    (unit,) = {one["depth_unit_scale_factor"] for one in told if "depth_unit_scale_factor" in one}
    assert unit * 65_535 >= float(deep.depth.max()) > 65.5
    assert f"--depth-unit-scale-factor {unit}\n" in (tmp_path / "out" / "README.txt").read_text()


def test_nerfstudio_s_depth_is_that_of_the_data_set(scenes, tmp_path):
    export_packed(scenes[:1], "nerfstudio", tmp_path / "out")
    scene, folder = scenes[0][1], tmp_path / "out" / "train" / "near-dome-00000"
    told = json.loads((folder / "transforms.json").read_text())
    unit = told["depth_unit_scale_factor"]
    for frame, view in zip(told["frames"], np.flatnonzero(scene.dome_id == 0), strict=True):
        with Image.open(folder / frame["depth_file_path"]) as image:
            whole = np.asarray(image)
        assert whole.dtype == np.uint16
        assert np.allclose(whole * unit, scene.depth[view], atol=unit)


@pytest.mark.parametrize("size", [None, (24, 18)])
def test_nerfstudio_gets_masks_of_a_whole_sequence_where_one_of_its_views_has_a_hole(scenes, tmp_path, size):
    name, scene, trained = scenes[0]
    views, alpha = np.flatnonzero(scene.dome_id == 0), scene.alpha.copy()
    alpha[views[1], 6:20, 8:30] = 0
    export_packed([(name, replace(scene, alpha=alpha), trained)], "nerfstudio", tmp_path / "out", size)
    whole = json.loads((tmp_path / "out" / "train" / "near-dome-00001" / "transforms.json").read_text())
    assert not any("mask_path" in frame for frame in whole["frames"]), "nothing is missing there"
    folder = tmp_path / "out" / "train" / "near-dome-00000"
    frames = json.loads((folder / "transforms.json").read_text())["frames"]
    step = 1 if size is None else 2
    for number, (frame, view) in enumerate(zip(frames, views, strict=True)):
        assert frame["mask_path"] == f"masks/{number:06d}.png"
        with Image.open(folder / frame["mask_path"]) as mask, Image.open(folder / frame["file_path"]) as image:
            assert mask.size == image.size and mask.mode == "L"
            assert np.array_equal(np.asarray(mask), alpha[view][::step, ::step]), "255 where it shows something, else 0"


@pytest.mark.parametrize("form", PACKED_FORMATS)
def test_every_format_has_the_size_that_is_asked_for_and_never_grows(scenes, tmp_path, form):
    counts = export_packed(scenes[:1], form, tmp_path / "out", (24, 18))
    assert counts["train"] == 5
    if form == CHUNKS:
        first = io.BytesIO(examples(tmp_path / "out", "train")["near"]["images"][0].numpy().tobytes())
    else:
        first = tmp_path / "out" / "train" / "near" / "images" / "000000.png"
    with Image.open(first) as image:
        assert image.size == (24, 18)
    with pytest.raises(UsageError, match="views of 49x18 px are larger than those of near, 48x36"):
        export_packed(scenes[:1], form, tmp_path / "larger", (49, 18))
    assert not (tmp_path / "larger").exists()


def test_a_folder_in_use_and_an_unknown_format_are_refused(scenes, tmp_path):
    (tmp_path / "note.txt").write_text("mine")
    with pytest.raises(UsageError, match="not an empty folder"):
        export_packed(scenes, CHUNKS, tmp_path)
    with pytest.raises(UsageError, match="no format 'zip'"):
        export_packed(scenes, "zip", tmp_path / "new")


def test_where_the_disk_is_full_it_is_named_and_nothing_is_left(scenes, tmp_path, monkeypatch):
    monkeypatch.setattr(Path, "write_text", full_disk)
    with pytest.raises(DiskFull, match=f"{tmp_path}/out: .*No space left"):
        export_packed(scenes[:1], CHUNKS, tmp_path / "out")
    assert not (tmp_path / "out").exists()
