from datetime import datetime

import numpy as np
import pytest
from PIL import Image

from aug3d_core.photos.exif import read_exif
from aug3d_core.town.config import TownConfig
from aug3d_core.town.drone.photo import Stamp, save_photo

STAMP = Stamp(datetime(2024, 6, 14, 10, 30, 12), 27, (-46.912345678, 7.498765432, 595.12))
UNKNOWN = Stamp(STAMP.time, None, None)


def save(path, seed: int = 0, stamp: Stamp = STAMP, noise: float = 1.3):
    save_photo(path, np.full((12, 16, 3), 100, np.uint8), stamp, noise, np.random.default_rng(seed))


def test_the_photograph_says_what_the_camera_knew(tmp_path):
    save(tmp_path / "a.jpg")
    with Image.open(tmp_path / "a.jpg") as image:
        exif = read_exif(image, image.size)
        assert image.format == "JPEG" and image.size == (16, 12)
    assert exif.focal_px == pytest.approx(TownConfig(width_px=640).focal_px * 16 / 640, rel=1e-3)
    assert exif.lat_deg == pytest.approx(STAMP.place[0], abs=1e-8)
    assert exif.lon_deg == pytest.approx(STAMP.place[1], abs=1e-8)
    assert exif.alt_m == pytest.approx(STAMP.place[2], abs=1e-3)
    assert exif.time == STAMP.time and exif.orientation == 1
    assert "aug3d" in exif.camera.lower()


def test_the_bytes_depend_on_the_arguments_alone(tmp_path):
    save(tmp_path / "a.jpg")
    save(tmp_path / "b.jpg")
    save(tmp_path / "c.jpg", seed=1)
    assert (tmp_path / "a.jpg").read_bytes() == (tmp_path / "b.jpg").read_bytes() != (tmp_path / "c.jpg").read_bytes()
    assert not list(tmp_path.glob("*.part"))


def test_what_the_camera_does_not_know_is_not_written(tmp_path):
    save(tmp_path / "a.jpg", stamp=UNKNOWN)
    with Image.open(tmp_path / "a.jpg") as image:
        exif = read_exif(image, image.size)
    assert np.isnan(exif.focal_px) and np.isnan(exif.lat_deg) and np.isnan(exif.alt_m)
    assert exif.time == STAMP.time


def test_below_sea_level(tmp_path):
    save(tmp_path / "a.jpg", stamp=Stamp(STAMP.time, 27, (10.0, 20.0, -12.5)))
    with Image.open(tmp_path / "a.jpg") as image:
        assert read_exif(image, image.size).alt_m == pytest.approx(-12.5)


def test_noise_is_as_strong_as_asked(tmp_path):
    image = np.full((60, 80, 3), 100, np.uint8)
    save_photo(tmp_path / "a.jpg", image, STAMP, 12.0, np.random.default_rng(0))
    with Image.open(tmp_path / "a.jpg") as stored:
        noise = np.asarray(stored, float)[..., 1] - 100
    assert noise.std() == pytest.approx(12, rel=0.15)
