"""The kind of pose files is seen from what lies there; what is none of them is told with the three kinds."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from aug3d_core.poses.recognise import COLMAP, MEGA_NERF, NERFSTUDIO, pose_digest, recognise
from aug3d_core.run.errors import InputError


def colmap(folder: Path, suffix: str = ".bin", points: int = 1, track: int = 2) -> Path:
    folder.mkdir(parents=True)
    for name in ("cameras", "images"):
        (folder / f"{name}{suffix}").write_bytes(b"")
    binary = struct.pack("<Q", points) + (struct.pack("<QdddBBBdQ", 1, 0, 0, 0, 9, 9, 9, 0.5, track)) * points
    text = "# a comment\n" + f"1 0 0 0 9 9 9 0.5{' 1 0' * track}\n" * points
    (folder / f"points3D{suffix}").write_bytes(binary if suffix == ".bin" else text.encode())
    return folder


@pytest.mark.parametrize("suffix", [".bin", ".txt"])
@pytest.mark.parametrize("place", [".", "sparse/0", "0"])
def test_a_colmap_model_and_its_parents(suffix: str, place: str, tmp_path: Path) -> None:
    folder = colmap(tmp_path / "scene" / place, suffix)
    found = recognise(tmp_path / "scene")
    assert (found.kind, found.has_points) == (COLMAP, True)
    assert found.folder.resolve() == folder.resolve()
    assert recognise(folder / f"images{suffix}").kind == COLMAP


@pytest.mark.parametrize("suffix", [".bin", ".txt"])
def test_a_colmap_model_without_points_or_without_what_sees_them(suffix: str, tmp_path: Path) -> None:
    assert not recognise(colmap(tmp_path / "model", suffix, points=0)).has_points
    assert not recognise(colmap(tmp_path / "cloud", suffix, track=0)).has_points


def test_a_colmap_model_that_lacks_a_file(tmp_path: Path) -> None:
    (colmap(tmp_path / "model") / "points3D.bin").unlink()
    with pytest.raises(InputError, match=r"incomplete COLMAP model: points3D\.bin is missing"):
        recognise(tmp_path / "model")


def test_transforms_json_and_its_folder(tmp_path: Path) -> None:
    (tmp_path / "transforms.json").write_text("{}")
    (tmp_path / "other.json").write_text("{}")
    assert recognise(tmp_path).kind == NERFSTUDIO
    assert recognise(tmp_path / "other.json").files == (tmp_path / "other.json",)


def test_a_mega_nerf_folder(tmp_path: Path) -> None:
    for split in ("train", "val"):
        (tmp_path / split / "metadata").mkdir(parents=True)
        (tmp_path / split / "metadata" / "000000.pt").touch()
    (tmp_path / "coordinates.pt").touch()
    found = recognise(tmp_path)
    assert found.kind == MEGA_NERF
    assert [file.parent.parent.name for file in found.files[1:]] == ["train", "val"]


def test_mega_nerf_without_its_metadata(tmp_path: Path) -> None:
    (tmp_path / "coordinates.pt").touch()
    with pytest.raises(InputError, match=r"no train/metadata"):
        recognise(tmp_path)


@pytest.mark.parametrize("name", [".", "missing", "notes.txt"])
def test_anything_else_is_told_with_the_three_kinds(name: str, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("x")
    with pytest.raises(InputError) as told:
        recognise(tmp_path / name)
    for kind in ("COLMAP", "transforms.json", "Mega-NeRF"):
        assert kind in told.value.remedy


def test_the_digest_is_of_the_poses_alone(tmp_path: Path) -> None:
    folder = colmap(tmp_path / "model")
    before = pose_digest(folder)
    (folder / "photo.jpg").write_bytes(b"x")
    assert pose_digest(folder) == before
    assert pose_digest(colmap(tmp_path / "scene" / "sparse" / "0").parents[1]) == before
    (folder / "images.bin").write_bytes(b"other")
    assert pose_digest(folder) != before
