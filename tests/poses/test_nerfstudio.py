"""transforms.json: every way in which one can be corrupt is told with the file and the frame."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aug3d_core.geometry.transforms import centres, forward
from aug3d_core.poses.nerfstudio import read_transforms
from aug3d_core.run.errors import InputError


def whole(**changes: Any) -> dict[str, Any]:
    frame = {"file_path": "./images/a.jpg", "transform_matrix": np.eye(4).tolist()}
    camera = {"w": 640, "h": 480, "fl_x": 500.0, "fl_y": 510.0, "cx": 320.0, "cy": 240.0}
    return {**camera, "frames": [frame, {**frame, "file_path": "b.jpg", **changes}]}


def read(content: Any, folder: Path) -> Any:
    file = folder / "transforms.json"
    file.write_text(content if isinstance(content, str) else json.dumps(content))
    return read_transforms(file)


def test_an_identity_pose_looks_along_minus_z(tmp_path: Path) -> None:
    entry = read(whole(), tmp_path)[0]
    (name, camera), *none = entry.names
    assert (name, none) == ("./images/a.jpg", [])
    assert (camera.model, camera.params) == ("PINHOLE", (500.0, 510.0, 320.0, 240.0))
    np.testing.assert_array_equal(centres(entry.cam_from_world), [0, 0, 0])
    np.testing.assert_array_equal(forward(entry.cam_from_world), [0, 0, -1])


def test_a_frame_has_the_last_word_on_its_camera(tmp_path: Path) -> None:
    a, b = read(whole(fl_x=600, k1=0.1, p2=0.2), tmp_path)
    assert a.names[0][1].params[0] == 500
    assert b.names[0][1].model == "OPENCV"
    assert b.names[0][1].params == (600, 510, 320, 240, 0.1, 0, 0, 0.2)


@pytest.mark.parametrize(
    ("changes", "model", "params"),
    [
        ({"camera_model": "OPENCV_FISHEYE", "k4": 0.4}, "OPENCV_FISHEYE", (0, 0, 0, 0.4)),
        ({"k3": 0.3}, "FULL_OPENCV", (0, 0, 0, 0, 0.3, 0, 0, 0)),
    ],
)
def test_more_camera_models(changes: dict, model: str, params: tuple, tmp_path: Path) -> None:
    camera = read(whole(**changes), tmp_path)[1].names[0][1]
    assert (camera.model, camera.params[4:]) == (model, params)


def no(key: str) -> dict[str, Any]:
    content = whole()
    content.pop(key, None)
    content["frames"][1].pop(key, None)
    return content


_LOPSIDED = np.diag([1.0, 1.0, 1.5, 1.0]).tolist()
_MIRRORED = np.diag([1.0, 1.0, -1.0, 1.0]).tolist()
_NAN = np.diag([1.0, 1.0, np.nan, 1.0]).tolist()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (json.dumps(whole())[:200], ["cannot be read as JSON"]),
        ("", ["cannot be read as JSON"]),
        ("\x00\xff", ["cannot be read as JSON"]),
        ([], ["no list `frames`"]),
        ({"frames": []}, ["no list `frames`"]),
        ({**whole(), "frames": [1]}, ["frame 0", "not an object"]),
        (no("file_path"), ["frame 1", "no file_path"]),
        (no("transform_matrix"), ["frame 1 (b.jpg)", "no transform_matrix"]),
        (no("w"), ["frame 0 (./images/a.jpg)", "has no w"]),
        (no("fl_x"), ["frame 0", "fl_x"]),
        (no("cy"), ["frame 0", "has no cy"]),
        (whole(file_path=7), ["frame 1", "file_path 7"]),
        (whole(file_path="./images/a.jpg"), ["frame 1", "same file as frame 0"]),
        (whole(transform_matrix=[[1, 2], [3, 4]]), ["frame 1 (b.jpg)", "not 4x4"]),
        (whole(transform_matrix="identity"), ["frame 1 (b.jpg)", "not 4x4"]),
        (whole(transform_matrix=[[1, 0, 0, 0], [0, 1, 0], [0, 0, 1, 0], [0]]), ["frame 1 (b.jpg)", "not 4x4"]),
        (whole(transform_matrix=_NAN), ["frame 1 (b.jpg)", "not a finite number"]),
        (whole(transform_matrix=_LOPSIDED), ["frame 1 (b.jpg)", "not a rotation"]),
        (whole(transform_matrix=_MIRRORED), ["frame 1 (b.jpg)", "not a rotation"]),
        (whole(fl_x="wide"), ["frame 1 (b.jpg)", "fl_x = 'wide'"]),
        (whole(k1=float("nan")), ["frame 1 (b.jpg)", "k1 = nan"]),
        (whole(h=0), ["frame 1 (b.jpg)", "640x0"]),
        (whole(fl_x=0.9), ["frame 1 (b.jpg)", "0.9 px cannot belong"]),
        (whole(camera_model="EQUIRECTANGULAR"), ["frame 1 (b.jpg)", "'EQUIRECTANGULAR'"]),
        (whole(k4=0.1), ["frame 1 (b.jpg)", "k4 = 0.1"]),
    ],
)
def test_a_corrupt_file(content: Any, words: list[str], tmp_path: Path) -> None:
    with pytest.raises(InputError) as told:
        read(content, tmp_path)
    for word in [str(tmp_path / "transforms.json"), *words]:
        assert word in told.value.problem
    assert told.value.remedy


def test_a_mask_is_named_by_the_frame_that_has_one(tmp_path: Path) -> None:
    assert [entry.mask for entry in read(whole(mask_path="masks/b.png"), tmp_path)] == [None, "masks/b.png"]


@pytest.mark.parametrize("mask", [7, "", ["b.png"], "\ud800"])
def test_a_mask_that_is_no_name_is_told(mask: Any, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"frame 1 \(b\.jpg\): mask_path .* is not a name"):
        read(whole(mask_path=mask), tmp_path)
