"""Damages to photographs, positions and tracks: no dose does nothing, a dose does what it says, and the rest stays whole."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import ExifTags, Image

from aug3d_core.geometry.transforms import centres, look_at
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.sfm.files import POINTS, TRACKS, VIEWS
from aug3d_core.studies.stability.damages import photographs, positions, tracks
from aug3d_core.studies.stability.positions_off import WILD_M, scattered, thrown
from aug3d_core.town.files import TOWN_PHOTOS, TOWN_TRUTH, TRUTH_POSES

PHOTOS = 6


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@pytest.fixture
def town(tmp_path: Path, rng: np.random.Generator) -> Path:
    """Return what the town's stage would leave: photographs along a line, 20 m apart, and their truth."""
    (tmp_path / TOWN_PHOTOS).mkdir()
    (tmp_path / TOWN_TRUTH).mkdir()
    exif = Image.Exif()
    exif[ExifTags.Base.Make] = "a camera"
    for number in range(PHOTOS):
        rgb = rng.integers(60, 180, (33, 44, 3)).astype(np.uint8)
        Image.fromarray(rgb).save(tmp_path / TOWN_PHOTOS / f"{number}.jpg", exif=exif, quality=95)
    eyes = np.column_stack([20.0 * np.arange(PHOTOS), np.zeros(PHOTOS), np.full(PHOTOS, 50.0)])
    poses = np.stack([look_at(eye, eye - (0, 0.1, 50)) for eye in eyes])
    intrinsics = np.tile([40.0, 40.0, 22.0, 16.5], (PHOTOS, 1))
    views = Views(np.arange(PHOTOS), poses, intrinsics, np.tile([44, 33], (PHOTOS, 1)))
    views.save(tmp_path / TRUTH_POSES)
    return tmp_path


def detail(folder: Path, number: int) -> float:
    with Image.open(folder / TOWN_PHOTOS / f"{number}.jpg") as image:
        assert image.getexif()[ExifTags.Base.Make] == "a camera", "EXIF stays"
        return float(np.abs(np.diff(np.asarray(image, float), axis=1)).mean())


def brightness(folder: Path, number: int) -> float:
    with Image.open(folder / TOWN_PHOTOS / f"{number}.jpg") as image:
        return float(np.asarray(image, float).mean())


@pytest.mark.parametrize(("damage", "harmless", "harm"), [(photographs.blur, 0, 3), (photographs.fade, 1, 0.05)])
def test_detail_goes_with_the_dose(damage, harmless: float, harm: float, town: Path, rng: np.random.Generator) -> None:
    before = detail(town, 0)
    damage(town, harmless, rng)
    assert detail(town, 0) == pytest.approx(before, rel=0.1)
    damage(town, harm, rng)
    assert 0.5 < detail(town, 0) < before / 4, "the sensor's noise stays"


def test_the_flights_second_half_is_brighter(town: Path, rng: np.random.Generator) -> None:
    before = brightness(town, 0)
    photographs.brighten(town, 4, rng)
    assert brightness(town, 2) == pytest.approx(before, rel=0.05) and brightness(town, 3) > 1.3 * before


def test_what_is_torn_apart_leaves_both_ends_and_a_truth_that_counts_them(town: Path, rng: np.random.Generator) -> None:
    photographs.tear_apart(town, 0, rng)
    assert len(Views.load(town / TRUTH_POSES)) == PHOTOS
    photographs.tear_apart(town, 50, rng)
    left = Views.load(town / TRUTH_POSES)
    assert [path.name for path in sorted((town / TOWN_PHOTOS).iterdir())] == ["0.jpg", "1.jpg", "4.jpg", "5.jpg"]
    assert left.photo_id.tolist() == [0, 1, 2, 3]
    assert centres(left.cam_from_world)[:, 0] == pytest.approx([0, 20, 80, 100])


@pytest.fixture
def table(tmp_path: Path) -> Path:
    places = {"lat_deg": 46.9 + 1e-4 * np.arange(10), "lon_deg": np.full(10, 7.5), "alt_m": np.full(10, 500.0)}
    pd.DataFrame({**places, "focal_px": np.full(10, 300.0)}).to_parquet(tmp_path / PHOTO_TABLE)
    return tmp_path


def test_the_focal_length_of_exif_is_multiplied(table: Path, rng: np.random.Generator) -> None:
    photographs.wrong_focal(table, 1.5, rng)
    assert (pd.read_parquet(table / PHOTO_TABLE)["focal_px"] == 450).all()


@pytest.mark.parametrize("damage", [positions.scatter, positions.throw])
def test_positions_are_moved_in_metres(damage, table: Path, rng: np.random.Generator) -> None:
    before = pd.read_parquet(table / PHOTO_TABLE)
    damage(table, 0.0, rng)
    pd.testing.assert_frame_equal(pd.read_parquet(table / PHOTO_TABLE), before, rtol=1e-9)
    damage(table, 1.0, rng)
    north_m = (pd.read_parquet(table / PHOTO_TABLE)["lat_deg"] - before["lat_deg"]) * 111_000
    assert 0.2 < north_m.std() < (3 if damage is positions.scatter else 110)


def test_a_share_is_thrown_a_hundred_metres_and_noise_has_its_deviation(rng: np.random.Generator) -> None:
    at_m = rng.normal(0, 50, (2000, 3))
    off_m = np.linalg.norm(thrown(at_m, 0.25, rng) - at_m, axis=1)
    assert ((off_m > 0).mean(), off_m.max()) == (0.25, pytest.approx(WILD_M))
    assert (scattered(at_m, 7.0, rng) - at_m).std() == pytest.approx(7.0, rel=0.05)


@pytest.fixture
def model(tmp_path: Path, rng: np.random.Generator) -> Path:
    seen = np.argwhere(rng.random((400, 10)) < 0.5)
    Tracks(seen[:, 0], seen[:, 1], rng.random((len(seen), 2))).save(tmp_path / TRACKS)
    Points(rng.random((400, 3)), np.zeros((400, 3), np.uint8), np.ones(400)).save(tmp_path / POINTS)
    views = np.arange(10)
    poses = np.tile(np.eye(4)[:3], (10, 1, 1))
    Views(views, poses, np.ones((10, 4)), np.ones((10, 2), int)).save(tmp_path / VIEWS)
    return tmp_path


@pytest.mark.parametrize(("damage", "harmless", "harm"), [(tracks.lose, 1, 0.1), (tracks.isolate, 0, 0.4)])
def test_what_is_left_of_points_is_seen_twice(damage, harmless: float, harm: float, model: Path, rng) -> None:
    before = Points.load(model / POINTS).xyz
    damage(model, harmless, rng)
    assert len(Points.load(model / POINTS).xyz) >= 0.95 * len(before)
    damage(model, harm, rng)
    points, left = Points.load(model / POINTS).xyz, Tracks.load(model / TRACKS)
    assert len(points) < len(before) and (np.bincount(left.point, minlength=len(points)) >= 2).all()
    assert set(map(tuple, points)) <= set(map(tuple, before))
    seen = np.sort(np.bincount(left.view, minlength=10))
    if damage is tracks.isolate:
        assert seen[3] < 20 < 80 < seen[4], "four of ten photographs see next to nothing"
    else:
        assert len(points) == pytest.approx(40, abs=15)
