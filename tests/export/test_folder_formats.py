"""What is exported reads back as it was, and nothing is overwritten."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from aug3d_core.export.folder_formats import export
from aug3d_core.geometry.masks import save_mask, used_pixels
from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.poses.match import match_photos
from aug3d_core.poses.nerfstudio import read_transforms
from aug3d_core.poses.recognise import COLMAP, NERFSTUDIO, recognise
from aug3d_core.run.errors import DiskFull, StoreError, UsageError
from tests.export.full_disk import full_disk


@pytest.fixture
def scene(tmp_path: Path) -> tuple[Path, Path, Views]:
    """Write an sfm output of three views of two cameras, and the photo table; photograph 1 was not placed."""
    rng = np.random.default_rng(0)
    views = Views(
        photo_id=np.array([0, 2, 3]),
        cam_from_world=np.stack([look_at(rng.normal(size=3) * 9 + [0, 0, 50], rng.normal(size=3)) for _ in range(3)]),
        intrinsics=np.array([[90.1, 91.2, 40.3, 30.4], [90.1, 91.2, 40.3, 30.4], [80.0, 80.0, 32.0, 24.0]]),
        size=np.array([[80, 60], [80, 60], [64, 48]]),
    )
    sfm, photos = tmp_path / "sfm", tmp_path / "photos"
    (sfm / "images").mkdir(parents=True)
    photos.mkdir()
    for photo_id, size in zip(views.photo_id, views.size, strict=True):
        Image.new("RGB", tuple(size.tolist()), (photo_id, 0, 0)).save(sfm / "images" / f"{photo_id:06d}.png")
    views.save(sfm / "views.npz")
    xyz = rng.normal(size=(4, 3))
    Points(xyz, rng.integers(0, 256, (4, 3)).astype(np.uint8), rng.random(4)).save(sfm / "points.npz")
    point, view = np.repeat(np.arange(4), 2), np.array([0, 1, 1, 2, 0, 2, 0, 1])
    Tracks(point, view, rng.random((8, 2)) * 40).save(sfm / "tracks.npz")
    names = ["a/1.jpg", "lost.jpg", "a/2.JPG", "b/2.JPG"]
    pd.DataFrame({"photo_id": range(4), "name": names}).to_parquet(photos / "photos.parquet")
    return sfm, photos, views


@pytest.mark.parametrize("form", [COLMAP, NERFSTUDIO])
def test_where_the_disk_is_full_it_is_named_and_nothing_is_left(
    form: str, scene: tuple[Path, Path, Views], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Path, "write_text", full_disk)
    with pytest.raises(DiskFull, match=f"{tmp_path}/out: .*No space left"):
        export(*scene[:2], form, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_nerfstudio_reads_back_to_the_same_poses_and_cameras(scene: tuple[Path, Path, Views], tmp_path: Path) -> None:
    sfm, photos, views = scene
    assert export(sfm, photos, NERFSTUDIO, tmp_path / "out") == 3
    entries = read_transforms(recognise(tmp_path / "out").files[0])
    np.testing.assert_allclose([entry.cam_from_world for entry in entries], views.cam_from_world, atol=1e-12)
    cameras = [entry.names[0][1] for entry in entries]
    np.testing.assert_array_equal([camera.params for camera in cameras], views.intrinsics)
    np.testing.assert_array_equal([(camera.width, camera.height) for camera in cameras], views.size)
    for entry, photo_id in zip(entries, views.photo_id, strict=True):
        with Image.open(tmp_path / "out" / entry.names[0][0]) as image:
            assert image.getpixel((0, 0)) == (photo_id, 0, 0)
    whole = json.loads((tmp_path / "out" / "transforms.json").read_text())
    assert (tmp_path / "out" / whole["ply_file_path"]).read_bytes().startswith(b"ply\n")


def test_exported_copies_are_found_again_but_never_taken_for_the_originals(
    scene: tuple[Path, Path, Views], tmp_path: Path
) -> None:
    sfm, photos, views = scene
    export(sfm, photos, NERFSTUDIO, tmp_path / "out")
    entries = read_transforms(tmp_path / "out" / "transforms.json")
    names = sorted(path.relative_to(tmp_path / "out" / "images").as_posix() for path in tmp_path.glob("out/images/*/*"))
    sides = ("width_px", "height_px", "original_width_px", "original_height_px")
    table = pd.DataFrame({"photo_id": range(3), "name": names}).assign(
        **{side: views.size[:, i % 2] for i, side in enumerate(sides)}
    )
    assert [one.source_id for one in match_photos(entries, table)] == [0, 1, 2]
    with pytest.raises(Exception, match="0 of their 3 names"):
        match_photos(entries, table.assign(name=["a/1.jpg", "a/2.JPG", "b/2.JPG"]))


def test_a_colmap_model_is_recognised_with_its_points(scene: tuple[Path, Path, Views], tmp_path: Path) -> None:
    sfm, photos, _ = scene
    export(sfm, photos, COLMAP, tmp_path / "out")
    found = recognise(tmp_path / "out")
    assert (found.kind, found.has_points) == (COLMAP, True)
    assert (tmp_path / "out" / "images" / "b" / "2.JPG.png").is_file()


def test_colmap_reads_names_that_had_spaces_as_the_files_are_called(
    scene: tuple[Path, Path, Views], tmp_path: Path
) -> None:
    """Its reader takes a name to end at the first space. One name is then what another is already."""
    sfm, photos, _ = scene
    names = ["a b/c d.jpg", "lost.jpg", "a_b/c_d.jpg", "e\u00a0f\tg.jpg"]
    pd.DataFrame({"photo_id": range(4), "name": names}).to_parquet(photos / "photos.parquet")
    export(sfm, photos, COLMAP, tmp_path / "out")
    code = (
        "import sys, json, pycolmap; model = pycolmap.Reconstruction(sys.argv[1]); "
        "print(json.dumps({image.name: i for i, image in model.images.items()}))"
    )
    model = tmp_path / "out" / "sparse" / "0"
    told = subprocess.run([sys.executable, "-c", code, model], check=True, capture_output=True, timeout=120)
    for photo_id, image_id in zip((0, 2, 3), (1, 2, 3), strict=True):
        (name,) = [name for name, number in json.loads(told.stdout).items() if number == image_id]
        with Image.open(tmp_path / "out" / "images" / name) as image:
            assert image.getpixel((0, 0)) == (photo_id, 0, 0)


@pytest.mark.parametrize("form", [COLMAP, NERFSTUDIO])
def test_nothing_is_overwritten(form: str, scene: tuple[Path, Path, Views], tmp_path: Path) -> None:
    sfm, photos, _ = scene
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("x")
    with pytest.raises(UsageError, match="out is not an empty folder"):
        export(sfm, photos, form, tmp_path / "out")
    with pytest.raises(UsageError, match="not an empty folder"):
        export(sfm, photos, form, tmp_path / "out" / "mine.txt")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["mine.txt"]


def test_a_scene_whose_files_are_gone(scene: tuple[Path, Path, Views], tmp_path: Path) -> None:
    (scene[0] / "views.npz").unlink()
    with pytest.raises(StoreError, match="the scene's files are missing"):
        export(scene[0], scene[1], COLMAP, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_unknown_format(scene: tuple[Path, Path, Views], tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no format 'obj'") as told:
        export(scene[0], scene[1], "obj", tmp_path / "out")
    assert "colmap, nerfstudio" in told.value.remedy
    assert not (tmp_path / "out").exists()


def test_nerfstudio_gets_a_mask_of_every_photograph_if_one_has_a_mask(
    scene: tuple[Path, Path, Views], tmp_path: Path
) -> None:
    sfm, photos, _ = scene
    export(sfm, photos, NERFSTUDIO, tmp_path / "plain")
    assert "mask_path" not in (tmp_path / "plain" / "transforms.json").read_text()
    assert not (tmp_path / "plain" / "masks").exists()
    used = np.ones((60, 80), bool)
    used[:20] = False
    save_mask(used, sfm / "masks" / "000002.png")
    export(sfm, photos, NERFSTUDIO, tmp_path / "out")
    frames = json.loads((tmp_path / "out" / "transforms.json").read_text())["frames"]
    found = [used_pixels(tmp_path / "out" / frame["mask_path"]) for frame in frames]
    for mask, truth in zip(found, (np.ones((60, 80), bool), used, np.ones((48, 64), bool)), strict=True):
        np.testing.assert_array_equal(mask, truth)
    assert len(read_transforms(recognise(tmp_path / "out").files[0])) == 3
