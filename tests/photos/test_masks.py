"""Masks beside photographs are taken over, or stop the run and say why."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import ExifTags, Image

from aug3d_core.geometry.masks import used_pixels
from aug3d_core.photos.config import PhotosConfig
from aug3d_core.photos.discover import find_photos
from aug3d_core.photos.files import PHOTO_IMAGES, PHOTO_MASKS, image_name, mask_path
from aug3d_core.photos.stage import run
from aug3d_core.run.errors import InputError
from aug3d_core.run.stage import Outcome
from tests.photos.photo_files import write_photo


def take_in(folder: Path, out: Path, min_photos: int = 3, **config: int) -> Outcome:
    out.mkdir(exist_ok=True)
    return run({"folder": folder}, PhotosConfig(min_photos=min_photos, **config), out, lambda done, total, what: None)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for i in range(3):
        write_photo(tmp_path / "in" / f"{i}.jpg", i, (330, 220))
    return tmp_path / "in"


def left_half(size: tuple[int, int] = (330, 220)) -> Image.Image:
    """Return a mask that leaves the left half out."""
    grey = np.full(size[::-1], 255, np.uint8)
    grey[:, : size[0] // 2] = 0
    return Image.fromarray(grey)


def test_a_mask_is_written_at_the_size_of_the_working_copy(folder: Path, tmp_path: Path) -> None:
    left_half().save(folder / "1_mask.png")
    outcome = take_in(folder, tmp_path / "out", max_px=165)
    assert [path.name for path in (tmp_path / "out" / PHOTO_MASKS).iterdir()] == [image_name(1)]
    used = used_pixels(mask_path(tmp_path / "out", 1))
    assert used is not None
    assert used.shape == (110, 165)
    assert not used[:, :82].any()
    assert used[:, 83:].all()
    assert outcome.metrics["masked"] == 1
    assert outcome.metrics["masked_share"] == pytest.approx(1 / 6, abs=0.002)


@pytest.mark.parametrize("mode", ["1", "L", "P", "RGB", "RGBA", "LA", "I;16"])
def test_a_mask_may_be_of_any_kind(folder: Path, tmp_path: Path, mode: str) -> None:
    mask = left_half()
    mask = Image.fromarray(np.asarray(mask).astype(np.uint16) * 257) if mode == "I;16" else mask.convert(mode)
    mask.save(folder / "0_mask.png")
    take_in(folder, tmp_path / "out")
    used = used_pixels(mask_path(tmp_path / "out", 0))
    assert used is not None
    np.testing.assert_array_equal(used, np.asarray(left_half()) > 0)


def test_what_is_transparent_is_left_out(folder: Path, tmp_path: Path) -> None:
    mask = Image.new("RGB", (330, 220), "white")
    mask.putalpha(left_half())
    mask.save(folder / "0_mask.png")
    take_in(folder, tmp_path / "out")
    used = used_pixels(mask_path(tmp_path / "out", 0))
    assert used is not None
    np.testing.assert_array_equal(used, np.asarray(left_half()) > 0)


def test_grey_is_used_from_the_middle_on(folder: Path, tmp_path: Path) -> None:
    grey = np.full((220, 330), 128, np.uint8)
    grey[:100] = 127
    Image.fromarray(grey).save(folder / "0_mask.png")
    take_in(folder, tmp_path / "out")
    used = used_pixels(mask_path(tmp_path / "out", 0))
    assert used is not None
    np.testing.assert_array_equal(used, grey == 128)


def test_a_mask_of_another_size_stops_the_run_and_both_sizes_are_told(folder: Path, tmp_path: Path) -> None:
    left_half((220, 330)).save(folder / "2_mask.png")
    with pytest.raises(InputError, match=r"2_mask\.png of photograph 2\.jpg .*220x330 px.* 330x220 px as it is stored"):
        take_in(folder, tmp_path / "out")


@pytest.mark.parametrize("orientation", [3, 6, 8])
@pytest.mark.parametrize("ending", ["jpg", "tif"])
def test_a_mask_is_as_the_photograph_is_stored_and_not_as_it_is_shown(
    folder: Path, tmp_path: Path, ending: str, orientation: int
) -> None:
    (folder / "0.jpg").unlink()
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = orientation
    left_half().convert("RGB").save(folder / f"0.{ending}", exif=exif)  # black where the mask leaves it out
    left_half().save(folder / "0_mask.png")
    assert take_in(folder, tmp_path / "out").metrics["masked"] == 1
    used = used_pixels(mask_path(tmp_path / "out", 0))
    with Image.open(tmp_path / "out" / PHOTO_IMAGES / image_name(0)) as copy:
        np.testing.assert_array_equal(used, np.asarray(copy.convert("L")) >= 128)


def test_a_mask_that_cannot_be_read_stops_the_run(folder: Path, tmp_path: Path) -> None:
    left_half().save(folder / "0_mask.png")
    (folder / "0_mask.png").write_bytes((folder / "0_mask.png").read_bytes()[:60])
    with pytest.raises(InputError, match=r"0_mask\.png of photograph 0\.jpg cannot be used: unreadable"):
        take_in(folder, tmp_path / "out")


def test_a_mask_that_leaves_nothing_stops_the_run(folder: Path, tmp_path: Path) -> None:
    Image.fromarray(np.asarray(left_half()) // 255).save(folder / "0_mask.png")  # 0 and 1 in place of 0 and 255
    with pytest.raises(InputError, match=r"0_mask\.png leaves nothing of photograph 0\.jpg"):
        take_in(folder, tmp_path / "out")


def test_masks_that_do_nothing_are_told(folder: Path, tmp_path: Path) -> None:
    write_photo(folder / "same.jpg", 0, (330, 220))
    left_half().save(folder / "same_mask.png")
    left_half().save(folder / "sub_mask.png")
    assert find_photos(folder).stray_masks == ("sub_mask.png",)
    notes = " ".join(take_in(folder, tmp_path / "out").notes)
    assert "1 masks lie beside no photograph" in notes
    assert "sub_mask.png" in notes
    assert "1 masks are of photographs that are not used" in notes
    assert not (tmp_path / "out" / PHOTO_MASKS).exists()


def test_a_folder_without_masks_has_no_files_and_no_notes_of_them(folder: Path, tmp_path: Path) -> None:
    outcome = take_in(folder, tmp_path / "out")
    assert not (tmp_path / "out" / PHOTO_MASKS).exists()
    assert outcome.metrics["masked"] == outcome.metrics["masked_share"] == 0
    assert not any("mask" in note for note in outcome.notes)
