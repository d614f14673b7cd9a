"""Photographs become working copies, or are rejected with a reason."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import ExifTags, Image, ImageFilter
from PIL.PngImagePlugin import PngImageFile

from aug3d_core.photos import decode as module
from aug3d_core.photos.config import PhotosConfig
from aug3d_core.photos.decode import decode, measure_sharpness
from aug3d_core.run.memory import MemoryBudget
from aug3d_core.run.picture import PictureError
from tests.photos.photo_files import pixels, write_photo


def decoded(path: Path, tmp_path: Path, **config: int) -> module.Decoded:
    return decode(path, path.name, tmp_path / "copy.png", PhotosConfig(**config), MemoryBudget(2**30))


def test_small_photographs_keep_their_pixels(tmp_path: Path) -> None:
    path = write_photo(tmp_path / "a.png", size=(321, 203))
    photo = decoded(path, tmp_path)
    assert photo.size == photo.original_size == (321, 203)
    np.testing.assert_array_equal(np.asarray(Image.open(photo.copy)), np.asarray(Image.open(path)))


@pytest.mark.parametrize(
    ("size", "expected"), [((640, 480), (200, 150)), ((480, 640), (150, 200)), ((901, 300), (200, 67))]
)
def test_large_photographs_are_reduced(tmp_path: Path, size: tuple[int, int], expected: tuple[int, int]) -> None:
    photo = decoded(write_photo(tmp_path / "a.jpg", size=size), tmp_path, max_px=200)
    assert photo.size == expected
    assert photo.original_size == size


@pytest.mark.parametrize("orientation", [2, 3, 6, 8])
@pytest.mark.parametrize("ending", ["jpg", "png", "tif"])
def test_the_orientation_tag_turns_nothing(tmp_path: Path, ending: str, orientation: int) -> None:
    photo = decoded(write_photo(tmp_path / f"a.{ending}", main={ExifTags.Base.Orientation: orientation}), tmp_path)
    assert photo.exif.orientation == orientation
    assert photo.size == photo.original_size == (320, 240)
    with Image.open(photo.copy) as copy:
        assert not copy.getexif()
        off = np.abs(np.asarray(copy).astype(int) - np.asarray(pixels()))
    assert off.mean() < (3 if ending == "jpg" else 1e-9), "a jpg loses some"


@pytest.mark.parametrize("compression", ["raw", "tiff_lzw"])  # Pillow decodes the first itself, the second by libtiff
@pytest.mark.parametrize("deep", [False, True])
def test_no_kind_of_tiff_is_turned(tmp_path: Path, deep: bool, compression: str) -> None:
    grey = np.asarray(pixels().convert("L"))
    stored = Image.fromarray(grey.astype(np.uint16) * 257 if deep else grey)
    stored.save(tmp_path / "a.tif", compression=compression, tiffinfo={ExifTags.Base.Orientation: 6})
    with Image.open(decoded(tmp_path / "a.tif", tmp_path).copy) as copy:
        np.testing.assert_array_equal(np.asarray(copy)[..., 0], grey)


@pytest.mark.parametrize("mode", ["L", "P", "RGBA", "CMYK", "I;16", "1"])
def test_every_mode_becomes_rgb(tmp_path: Path, mode: str) -> None:
    if mode == "I;16":
        image = Image.fromarray(np.asarray(pixels().convert("L")).astype(np.uint16) * 257)
    else:
        image = pixels().convert(mode)
    image.save(tmp_path / "a.tif")
    copy = Image.open(decoded(tmp_path / "a.tif", tmp_path).copy)
    assert copy.mode == "RGB"
    assert np.std(np.asarray(copy)) > 10


def test_deep_grey_keeps_its_tones(tmp_path: Path) -> None:
    grey = np.asarray(pixels().convert("L"))
    Image.fromarray(grey.astype(np.uint16) * 257).save(tmp_path / "a.tif")
    copy = np.asarray(Image.open(decoded(tmp_path / "a.tif", tmp_path).copy))
    np.testing.assert_array_equal(copy[..., 0], grey)


def test_floating_point_pixels_are_refused(tmp_path: Path) -> None:
    """They have no range that is known: taken as 0 to 255, heights or reflectances would come out white or black."""
    Image.fromarray(np.asarray(pixels().convert("L"), np.float32) * 40).save(tmp_path / "a.tif")
    with pytest.raises(PictureError, match="floating-point pixels: convert it to 8 or 16 bits a channel"):
        decoded(tmp_path / "a.tif", tmp_path)


def test_a_truncated_jpeg(tmp_path: Path) -> None:
    path = write_photo(tmp_path / "a.jpg")
    path.write_bytes(path.read_bytes()[:-800])
    with pytest.raises(PictureError, match="unreadable: image file is truncated"):
        decoded(path, tmp_path)
    assert not (tmp_path / "copy.png").exists()


def test_text_that_calls_itself_a_photograph(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_text("not a photograph")
    with pytest.raises(PictureError, match="not a JPEG, PNG or TIFF image"):
        decoded(tmp_path / "a.jpg", tmp_path)


def test_an_empty_file(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").touch()
    with pytest.raises(PictureError, match="unreadable"):
        decoded(tmp_path / "a.jpg", tmp_path)


def test_a_broken_link_is_named_without_its_path(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").symlink_to(tmp_path / "gone.jpg")
    with pytest.raises(PictureError) as rejected:
        decoded(tmp_path / "a.jpg", tmp_path)
    assert "No such file" in str(rejected.value)
    assert str(tmp_path) not in str(rejected.value)


def test_a_tiny_photograph(tmp_path: Path) -> None:
    with pytest.raises(PictureError, match="tiny: 160x120 px, shortest side under 160 px"):
        decoded(write_photo(tmp_path / "a.jpg", size=(160, 120)), tmp_path)


def test_a_decompression_bomb(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_photo(tmp_path / "a.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1000)
    with pytest.raises(PictureError, match="too large"):
        decoded(path, tmp_path)


def test_what_takes_more_memory_than_may_be_used_is_not_decoded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The header says so; a JPEG decodes at a fraction of its size and takes less."""
    monkeypatch.setattr(PngImageFile, "load", lambda image: pytest.fail("it was decoded"))
    path = write_photo(tmp_path / "a.png", size=(1000, 800))
    with pytest.raises(PictureError, match=r"too large: 1000x800 px take 0\.0 GiB to decode; a quarter of the memory"):
        decode(path, path.name, tmp_path / "copy.png", PhotosConfig(), MemoryBudget(9_000_000))
    monkeypatch.undo()
    path = write_photo(tmp_path / "a.jpg", size=(1000, 800))
    assert decode(path, path.name, tmp_path / "copy.png", PhotosConfig(max_px=200), MemoryBudget(9_000_000)).size == (
        200,
        160,
    )


def test_sixteen_bits_are_the_same_in_strips(tmp_path: Path) -> None:
    grey = np.random.default_rng(0).integers(0, 65536, (701, 331)).astype(np.uint16)
    Image.fromarray(grey).save(tmp_path / "a.png")
    copy = np.asarray(Image.open(decoded(tmp_path / "a.png", tmp_path).copy))
    np.testing.assert_array_equal(copy[..., 0], grey // 257)


@pytest.mark.parametrize("name", ["pipe.jpg", "device.png"])
def test_what_is_no_file_is_refused_without_waiting(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    os.mkfifo(path) if name == "pipe.jpg" else path.symlink_to("/dev/zero")
    with pytest.raises(PictureError, match="unreadable: it is no file but a pipe, a socket or a device"):
        decoded(path, tmp_path)


def test_same_pixels_in_another_file_have_the_same_pixel_digest(tmp_path: Path) -> None:
    png = decoded(write_photo(tmp_path / "a.png"), tmp_path)
    tiff = decoded(write_photo(tmp_path / "a.tif"), tmp_path)
    other = decoded(write_photo(tmp_path / "b.png", seed=1), tmp_path)
    assert png.pixels_sha256 == tiff.pixels_sha256 != other.pixels_sha256
    assert png.sha256 != tiff.sha256


def test_blur_lowers_sharpness_and_size_does_not() -> None:
    sharp = pixels(size=(1024, 768))
    blurred = sharp.filter(ImageFilter.GaussianBlur(4))
    smaller = sharp.resize((512, 384), Image.Resampling.LANCZOS)
    assert measure_sharpness(np.asarray(blurred)) < 0.8 * measure_sharpness(np.asarray(sharp))
    assert measure_sharpness(np.asarray(smaller)) == pytest.approx(measure_sharpness(np.asarray(sharp)), rel=0.05)


def test_a_flat_picture_has_no_sharpness() -> None:
    assert measure_sharpness(np.full((7, 11, 3), 90, np.uint8)) == 0
