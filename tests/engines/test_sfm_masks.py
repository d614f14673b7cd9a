"""Masks on the way from photographs to posed views: what is masked is not matched, and masks follow their photographs."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap
import pytest
from PIL import Image

from aug3d_core.geometry.masks import save_mask, used_pixels
from aug3d_core.photos.files import image_name, mask_path
from aug3d_core.run.files import EARLIER
from aug3d_core.sfm import export
from aug3d_core.sfm.files import FEATURES, VIEW_IMAGES, VIEW_MASKS
from tests.engines.little_scene import SIZE, poses, write_flight
from tests.engines.sfm_runs import loaded, outcome_of, run_sfm, run_stage, take_photos

pytestmark = pytest.mark.slow

PHOTOS = 6
LEG = (slice(150, 230), slice(20, 150))  # rows and columns of a part of the drone that every photograph shows
BARE = 5  # the one photograph without it, and without a mask


def write_masked(folder: Path) -> Path:
    """Write photographs in which a leg of the drone, full of features, is masked."""
    flight = write_flight(folder.with_name("plain"), poses(3, 2), noise_m=0.2)
    folder.mkdir()
    leg = np.random.default_rng(0).integers(0, 2, (20, 33, 1)).repeat(4, 0).repeat(4, 1)[:80, :130] * [255, 0, 255]
    for number in range(PHOTOS):
        with Image.open(flight / f"photo_{number}.jpg") as image:
            pixels, exif = np.array(image), image.getexif()
        if number != BARE:
            pixels[LEG] = leg
            used = np.ones(SIZE[::-1], bool)
            used[LEG] = False
            save_mask(used, folder / f"photo_{number}_mask.png")
        Image.fromarray(pixels).save(folder / f"photo_{number}.png", exif=exif)
    return folder


@pytest.fixture(scope="module")
def masked(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Return the folder of a flight with masks, up to its poses, and the outcome of sfm."""
    folder = tmp_path_factory.mktemp("masked")
    photos = take_photos(write_masked(folder / "in"), folder / "photos")
    return folder, run_sfm(photos, folder / "sfm")


def keypoints(files: Path, scratch: Path) -> list[np.ndarray]:
    copied = shutil.copy(files / FEATURES, scratch)  # to open it is to write to it
    with pycolmap.Database.open(copied) as database:
        by_name = {image.name: image.image_id for image in database.read_all_images()}
        return [database.read_keypoints(by_name[image_name(i)])[:, :2] for i in range(PHOTOS)]


def within_leg(xy: np.ndarray) -> np.ndarray:
    rows, columns = LEG
    return (xy >= [columns.start, rows.start]).all(axis=1) & (xy < [columns.stop, rows.stop]).all(axis=1)


def test_no_feature_is_masked_and_elsewhere_they_are_as_ever(
    masked: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    shutil.copytree(masked[0] / "in", tmp_path / "in", ignore=shutil.ignore_patterns("*_mask.png"))
    bare = take_photos(tmp_path / "in", tmp_path / "photos")
    run_stage("matching", tmp_path / "matching", {"photos": bare})
    (tmp_path / "one").mkdir(), (tmp_path / "two").mkdir()
    masked_xy = keypoints(masked[0] / "sfm_matching" / "files", tmp_path / "one")
    unmasked_xy = keypoints(tmp_path / "matching" / "files", tmp_path / "two")
    for number, (with_mask, without) in enumerate(zip(masked_xy, unmasked_xy, strict=True)):
        assert number == BARE or within_leg(without).sum() > 100, "or there is nothing to leave out"
        kept = without if number == BARE else without[~within_leg(without)]
        np.testing.assert_array_equal(with_mask, kept)


def test_another_mask_makes_new_features_of_its_photograph_alone(
    masked: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    shutil.copytree(masked[0] / "in", tmp_path / "in")
    used = np.ones(SIZE[::-1], bool)
    used[100:] = False
    save_mask(used, tmp_path / "in" / "photo_1_mask.png")
    photos = take_photos(tmp_path / "in", tmp_path / "photos")
    (tmp_path / "earlier").mkdir()
    (tmp_path / "earlier" / "00").symlink_to(masked[0] / "sfm_matching" / "files")
    outcome = run_stage("matching", tmp_path / "grown", {"photos": photos, EARLIER: tmp_path / "earlier"})
    assert outcome["metrics"]["photos_reused"] == PHOTOS - 1
    assert outcome["metrics"]["pairs_reused"] == (PHOTOS - 1) * (PHOTOS - 2) / 2
    assert keypoints(tmp_path / "grown" / "files", tmp_path)[1][:, 1].max() < 100


def test_masks_are_undistorted_as_their_photographs_are(masked: tuple[Path, dict[str, Any]]) -> None:
    folder, outcome = masked
    views, _, tracks = loaded(folder / "sfm")
    assert outcome["metrics"]["registered"] == PHOTOS
    files = folder / "sfm" / "files"
    assert not (files / VIEW_MASKS / image_name(BARE)).exists()
    for view, (photo_id, size) in enumerate(zip(views.photo_id, views.size, strict=True)):
        if photo_id == BARE:
            continue
        used = used_pixels(files / VIEW_MASKS / image_name(photo_id))
        assert used is not None
        assert used.shape == tuple(size[::-1])
        with Image.open(files / VIEW_IMAGES / image_name(photo_id)) as image:
            leg = np.asarray(image)[..., 1] == 0
        assert (leg & used).sum() < 0.02 * leg.sum()
        x, y = tracks.xy[tracks.view == view].astype(int).T
        assert used[y, x].mean() > 0.99


def test_a_scene_without_masks_has_no_file_of_them(little_flight: Path) -> None:
    for files in ("photos", "sfm/files"):
        assert not (little_flight / files / "masks").exists()
    assert outcome_of(little_flight / "sfm")["state"] == "ok"


def test_a_mask_bends_with_a_strong_lens(tmp_path: Path) -> None:
    width, height = SIZE
    camera = pycolmap.Camera(
        model="SIMPLE_RADIAL", width=width, height=height, params=[250, width / 2, height / 2, -0.15], camera_id=1
    )
    model = pycolmap.Reconstruction()
    model.add_camera_with_trivial_rig(camera)
    model.add_image_with_trivial_frame(
        pycolmap.Image(image_name(3), np.zeros((0, 2)), camera_id=1, image_id=1), pycolmap.Rigid3d()
    )
    rng = np.random.default_rng(0)
    used = rng.random((height // 16, width // 16)).repeat(16, 0).repeat(16, 1) > 0.4
    save_mask(used, mask_path(tmp_path, 3))
    grey = Image.fromarray(np.where(used, np.uint8(200), np.uint8(40))).convert("RGB")
    (tmp_path / "images").mkdir()
    grey.save(tmp_path / "images" / image_name(3))
    export.write_undistorted(model, tmp_path / "images", tmp_path / "out", {}, {})
    export.write_undistorted_masks(model, tmp_path / "masks", tmp_path / "out_masks")
    found = used_pixels(tmp_path / "out_masks" / image_name(3))
    with Image.open(tmp_path / "out" / image_name(3)) as image:
        shown = np.asarray(image)[..., 0] >= 120
    assert found is not None
    assert (found != shown).mean() < 0.001  # a level that ends in the middle may be rounded either way
    assert not np.array_equal(found, used[: len(shown), : shown.shape[1]]), "the lens bends nothing"
