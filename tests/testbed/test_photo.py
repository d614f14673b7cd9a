from datetime import datetime

import numpy as np
import pytest
from PIL import Image

from aug3d_core.photos.exif import read_exif
from aug3d_core.testbed.config import TownConfig
from aug3d_core.testbed.photo import Stamp, save_photo

STAMP = Stamp(datetime(2024, 6, 14, 10, 30, 12), 27, -46.912345678, 7.498765432, 595.12)


def save(path, seed: int = 0):
    save_photo(path, np.full((12, 16, 3), 100, np.uint8), STAMP, np.random.default_rng(seed))


def test_the_photograph_says_what_the_camera_knew(tmp_path):
    save(tmp_path / "a.jpg")
    with Image.open(tmp_path / "a.jpg") as image:
        exif = read_exif(image)
        assert image.format == "JPEG" and image.size == (16, 12)
    assert exif.focal_px == pytest.approx(TownConfig(width_px=640).focal_px * 16 / 640, rel=1e-3)
    assert exif.lat_deg == pytest.approx(STAMP.lat_deg, abs=1e-8)
    assert exif.lon_deg == pytest.approx(STAMP.lon_deg, abs=1e-8)
    assert exif.alt_m == pytest.approx(STAMP.alt_m, abs=1e-3)
    assert exif.time == STAMP.time and exif.orientation == 1
    assert "aug3d" in exif.camera.lower()


def test_the_bytes_depend_on_the_arguments_alone(tmp_path):
    save(tmp_path / "a.jpg")
    save(tmp_path / "b.jpg")
    save(tmp_path / "c.jpg", seed=1)
    assert (tmp_path / "a.jpg").read_bytes() == (tmp_path / "b.jpg").read_bytes() != (tmp_path / "c.jpg").read_bytes()
    assert not list(tmp_path.glob("*.part"))
