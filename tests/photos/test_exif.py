"""What cameras write is read; what they write wrongly is unknown."""

from __future__ import annotations

import math
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from PIL import ExifTags, Image
from PIL.TiffImagePlugin import IFDRational

from aug3d_core.photos.exif import Exif, read_exif
from tests.photos.photo_files import degrees, write_photo

TAG = ExifTags.Base
GPS = ExifTags.GPS


def exif_of(tmp_path: Path, suffix: str = ".jpg", **tags: Any) -> Exif:
    with Image.open(write_photo(tmp_path / f"photo{suffix}", **tags)) as image:
        return read_exif(image, image.size)


def test_no_exif_is_unknown(tmp_path: Path) -> None:
    exif = exif_of(tmp_path)
    assert math.isnan(exif.focal_px)
    assert exif.focal_source == "none"
    assert math.isnan(exif.lat_deg)
    assert exif.time is None
    assert exif.orientation == 1
    assert exif.camera == "unknown 320x240"


def test_35mm_equivalent_compares_diagonals(tmp_path: Path) -> None:
    exif = exif_of(tmp_path, detail={TAG.FocalLengthIn35mmFilm: 24})
    assert exif.focal_px == pytest.approx(24 / math.hypot(36, 24) * 400)
    assert exif.focal_source == "35mm"


def test_a_wide_frame_is_a_full_width_crop_of_a_4_3_sensor(tmp_path: Path) -> None:
    # DJI FC300S: 3.61 mm over a 6.17 mm wide sensor, so 599 px at 1024; its 16:9 frames keep the width.
    exif = exif_of(
        tmp_path, size=(1024, 576), detail={TAG.FocalLengthIn35mmFilm: 20, TAG.FocalLength: IFDRational(361, 100)}
    )
    assert exif.focal_px == pytest.approx(3.61 / 6.17 * 1024, rel=0.02)


def test_focal_plane_counts_pixels_of_the_photograph_as_taken(tmp_path: Path) -> None:
    taken = {TAG.ExifImageWidth: 4608, TAG.ExifImageHeight: 3456, TAG.FocalPlaneResolutionUnit: 2}
    focal = {TAG.FocalLength: IFDRational(5), TAG.FocalPlaneXResolution: IFDRational(17791506, 1000)}
    exif = exif_of(tmp_path, detail=taken | focal)
    assert exif.focal_px == pytest.approx(5 * 17791.506 / 25.4 * 320 / 4608)
    assert exif.focal_source == "focal_plane"


def test_focal_plane_wins_over_the_rounded_35mm_equivalent(tmp_path: Path) -> None:
    focal = {
        TAG.FocalLength: IFDRational(10),
        TAG.FocalPlaneXResolution: IFDRational(30),
        TAG.FocalPlaneResolutionUnit: 4,
    }
    exif = exif_of(tmp_path, detail=focal | {TAG.FocalLengthIn35mmFilm: 35})
    assert (exif.focal_px, exif.focal_source) == (pytest.approx(300), "focal_plane")


def test_a_turned_photograph_has_the_same_focal_length(tmp_path: Path) -> None:
    taken = {TAG.ExifImageWidth: 640, TAG.ExifImageHeight: 480, TAG.FocalPlaneResolutionUnit: 4}
    focal = {TAG.FocalLength: IFDRational(10), TAG.FocalPlaneXResolution: IFDRational(60)}
    exif = exif_of(tmp_path, size=(240, 320), detail=taken | focal)
    assert exif.focal_px == pytest.approx(300)


def test_a_crop_makes_the_focal_plane_useless(tmp_path: Path) -> None:
    taken = {TAG.ExifImageWidth: 4000, TAG.ExifImageHeight: 2000, TAG.FocalPlaneResolutionUnit: 4}
    focal = {TAG.FocalLength: IFDRational(10), TAG.FocalPlaneXResolution: IFDRational(400)}
    assert exif_of(tmp_path, detail=taken | focal).focal_source == "none"


@pytest.mark.parametrize("focal", [{TAG.FocalLength: IFDRational(5)}, {TAG.FocalLengthIn35mmFilm: 0}])
def test_millimetres_without_a_sensor_are_unknown(tmp_path: Path, focal: dict[int, Any]) -> None:
    assert exif_of(tmp_path, detail=focal).focal_source == "none"


@pytest.mark.parametrize(("lat", "lon"), [(46.842607, -91.99456), (-33.9, 151.2), (0.5, -0.5)])
def test_position_and_its_hemispheres(tmp_path: Path, lat: float, lon: float) -> None:
    gps = {
        GPS.GPSLatitude: degrees(lat),
        GPS.GPSLatitudeRef: "N" if lat > 0 else "S",
        GPS.GPSLongitude: degrees(lon),
        GPS.GPSLongitudeRef: "E" if lon > 0 else "W",
        GPS.GPSAltitude: IFDRational(1983, 10),
    }
    exif = exif_of(tmp_path, gps=gps)
    assert (exif.lat_deg, exif.lon_deg) == (pytest.approx(lat, abs=1e-7), pytest.approx(lon, abs=1e-7))
    assert exif.alt_m == pytest.approx(198.3)


@pytest.mark.parametrize(
    ("south", "west"), [("S\0", "W\0"), ("S ", " w"), ("South", "West"), (b"S", b"W\0"), ("s", "W")]
)
def test_hemispheres_as_cameras_write_them(south: str | bytes, west: str | bytes) -> None:
    exif = Image.Exif()
    exif.get_ifd(ExifTags.IFD.GPSInfo).update(
        {
            GPS.GPSLatitude: degrees(33.9),
            GPS.GPSLatitudeRef: south,
            GPS.GPSLongitude: degrees(70.7),
            GPS.GPSLongitudeRef: west,
        }
    )
    image = Image.new("RGB", (7, 11))
    image.getexif = lambda: exif  # Pillow writes no bytes for a tag of letters, and other writers do
    found = read_exif(image, image.size)
    assert (found.lat_deg, found.lon_deg) == (pytest.approx(-33.9, abs=1e-7), pytest.approx(-70.7, abs=1e-7))


def test_below_the_sea(tmp_path: Path) -> None:
    gps = {
        GPS.GPSLatitude: degrees(31.5),
        GPS.GPSLatitudeRef: "N",
        GPS.GPSLongitude: degrees(35.5),
        GPS.GPSLongitudeRef: "E",
    }
    exif = exif_of(tmp_path, gps=gps | {GPS.GPSAltitude: IFDRational(400), GPS.GPSAltitudeRef: b"\x01"})
    assert exif.alt_m == -400


@pytest.mark.parametrize(
    "gps",
    [
        {GPS.GPSLatitude: degrees(0), GPS.GPSLongitude: degrees(0)},
        {GPS.GPSLatitude: degrees(46)},
        {GPS.GPSLatitude: (IFDRational(0, 0),) * 3, GPS.GPSLongitude: degrees(5)},
        {GPS.GPSLatitude: degrees(95), GPS.GPSLongitude: degrees(5)},
    ],
    ids=["no fix", "half a position", "zero denominators", "off the globe"],
)
def test_positions_that_are_none(tmp_path: Path, gps: dict[int, Any]) -> None:
    exif = exif_of(tmp_path, gps=gps)
    assert math.isnan(exif.lat_deg)
    assert math.isnan(exif.lon_deg)


def test_time_with_fraction(tmp_path: Path) -> None:
    detail = {TAG.DateTimeOriginal: "2012:07:20 18:08:51", TAG.SubsecTimeOriginal: "25"}
    assert exif_of(tmp_path, detail=detail).time == datetime(2012, 7, 20, 18, 8, 51, 250_000)


@pytest.mark.parametrize("text", ["0000:00:00 00:00:00", "    :  :     :  :  ", "yesterday", ""])
def test_times_that_are_none(tmp_path: Path, text: str) -> None:
    assert exif_of(tmp_path, detail={TAG.DateTimeOriginal: text}).time is None


@pytest.mark.parametrize(("tag", "expected"), [(6, 6), (1, 1), (0, 1), (77, 1)])
def test_orientation_is_recorded(tmp_path: Path, tag: int, expected: int) -> None:
    assert exif_of(tmp_path, main={TAG.Orientation: tag}).orientation == expected


@pytest.mark.parametrize("model", ["Canon PowerShot A3300 IS", "PowerShot A3300 IS"])
def test_a_make_that_the_model_names_too_is_named_once(tmp_path: Path, model: str) -> None:
    exif = exif_of(tmp_path, main={TAG.Make: "Canon", TAG.Model: model})
    assert exif.camera == "Canon PowerShot A3300 IS 320x240"


def test_zoom_makes_another_camera(tmp_path: Path) -> None:
    main = {TAG.Make: "DJI\0\0", TAG.Model: "FC300S \0"}
    near = exif_of(tmp_path, main=main, detail={TAG.FocalLength: IFDRational(361, 100)})
    far = exif_of(tmp_path, main=main, detail={TAG.FocalLength: IFDRational(722, 100)})
    assert near.camera == "DJI FC300S 320x240 3.61mm"
    assert far.camera != near.camera


def test_two_drones_of_one_model_are_two_cameras(tmp_path: Path) -> None:
    main = {TAG.Make: "DJI", TAG.Model: "FC300S"}
    one, two = (exif_of(tmp_path, main=main, detail={TAG.BodySerialNumber: f"{number}\0\0"}) for number in (481, 482))
    assert (one.camera, two.camera) == ("DJI FC300S 481 320x240", "DJI FC300S 482 320x240")


def test_png_and_tiff_have_exif_too(tmp_path: Path) -> None:
    for suffix in (".png", ".tif"):
        exif = exif_of(tmp_path, suffix, main={TAG.Model: "scanner", TAG.Orientation: 3})
        assert exif.camera.startswith("scanner")
        assert exif.orientation == 3
