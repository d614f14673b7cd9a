"""Poses from elsewhere on the command line: recognised at once, refused in one sentence, exported again."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aug3d_core.geometry.camera_models import world_from_gl
from aug3d_core.geometry.transforms import homogeneous
from tests.engines.little_scene import FOCAL_PX, SIZE, poses, write_flight

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


def aug3d(*words: str | Path, env: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    program = str(Path(sys.executable).parent / "aug3d")
    return subprocess.run([program, *map(str, words)], capture_output=True, text=True, check=False, env=env)


def transforms(file: Path, **changes: Any) -> Path:
    """Write the true poses of the flight, or what `changes` makes of them."""
    camera = {"w": SIZE[0], "h": SIZE[1], "fl_x": FOCAL_PX, "fl_y": FOCAL_PX, "cx": SIZE[0] / 2, "cy": SIZE[1] / 2}
    frames = [
        {"file_path": f"images/photo_{i}.jpg", "transform_matrix": matrix.tolist()}
        for i, matrix in enumerate(homogeneous(world_from_gl(poses())))
    ]
    file.write_text(json.dumps({**camera, "frames": frames, **changes}))
    return file


@pytest.fixture(scope="module")
def photos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_flight(tmp_path_factory.mktemp("flight") / "photos", poses())


def test_a_dry_run_names_the_stages_that_given_poses_need(photos: Path, tmp_path: Path) -> None:
    run = ("run", "flight", "--photos", photos, "--home", tmp_path / "home", "--dry-run", "--json")
    with_poses = json.loads(aug3d(*run, "--poses", transforms(tmp_path / "transforms.json")).stdout)
    assert [step["stage"] for step in with_poses][:4] == ["photos", "poses", "matching", "sfm"]
    model = tmp_path / "model"
    model.mkdir()
    for name in ("cameras", "images", "points3D"):
        (model / f"{name}.txt").write_text("1 0 0 0 9 9 9 0.5 1 0 2 0\n")
    with_points = json.loads(aug3d(*run, "--poses", model).stdout)
    assert [step["stage"] for step in with_points][:3] == ["photos", "poses", "sfm"]


def test_what_holds_no_poses_is_told_before_anything_is_started(photos: Path, tmp_path: Path) -> None:
    done = aug3d("run", "flight", "--photos", photos, "--poses", photos, "--home", tmp_path / "home")
    assert done.returncode == 1
    assert f"{photos} holds no camera poses" in done.stderr
    for kind in ("COLMAP", "transforms.json", "Mega-NeRF"):
        assert kind in done.stderr
    assert not (tmp_path / "home").exists()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"frames": [{"file_path": "a.jpg", "transform_matrix": np.diag([1.0, 1, 2, 1]).tolist()}]}, "frame 0 (a.jpg)"),
        ({"frames": [{"file_path": "a.jpg", "transform_matrix": np.eye(4).tolist()}]}, "0 of their 1 names"),
    ],
)
def test_poses_that_cannot_be_used_end_in_one_sentence(
    changes: dict[str, Any], words: str, photos: Path, tmp_path: Path, served: dict[str, str]
) -> None:
    home, given = tmp_path / "home", transforms(tmp_path / "transforms.json", **changes)
    done = aug3d("run", "bad", "--photos", photos, "--poses", given, "--json", "--home", home, env=served)
    assert done.returncode == 1, done.stderr
    failure = json.loads(done.stdout)["failure"]
    assert words in failure["problem"] and failure["remedy"]
    shown = json.loads(aug3d("show", "bad", "--json", "--home", home).stdout)
    assert list(shown["stages"]) == ["photos"] and shown["failure"] == failure
    exported = aug3d("export", "bad", tmp_path / "out", "--format", "colmap", "--home", home)
    assert exported.returncode == 2
    assert "has no sfm" in exported.stderr
