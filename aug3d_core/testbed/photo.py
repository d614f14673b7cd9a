"""The JPEG that the drone's camera writes: sensor grain, and EXIF with time, focal length and GPS."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from PIL import ExifTags, Image, TiffImagePlugin

_QUALITY = 92
_GRAIN = 1.3  # standard deviation of the sensor's noise, of 255
_SENSOR_DIAGONAL_MM = 7.7


@dataclass(frozen=True)
class Stamp:
    """What the camera knows about a photograph."""

    time: datetime
    focal_35mm: int
    lat_deg: float
    lon_deg: float
    alt_m: float


def save_photo(path: Path, rgb: UInt8[np.ndarray, "h w 3"], stamp: Stamp, rng: np.random.Generator) -> None:
    """Write a photograph in one piece; the bytes depend on the arguments alone."""
    noisy = rgb + rng.normal(0, _GRAIN, rgb.shape)
    image = Image.fromarray(np.rint(np.clip(noisy, 0, 255)).astype(np.uint8))
    part = path.with_suffix(".part")
    image.save(part, format="JPEG", quality=_QUALITY, subsampling=0, exif=_exif(stamp))
    part.replace(path)


def _exif(stamp: Stamp) -> Image.Exif:
    base, gps = ExifTags.Base, ExifTags.GPS
    time = stamp.time.strftime("%Y:%m:%d %H:%M:%S")
    exif = Image.Exif()
    exif[base.Make], exif[base.Model], exif[base.Orientation], exif[base.DateTime] = "aug3d", "Testbed", 1, time
    details = exif.get_ifd(ExifTags.IFD.Exif)
    details[base.DateTimeOriginal] = time
    details[base.FocalLength] = _rational(stamp.focal_35mm / 43.27 * _SENSOR_DIAGONAL_MM, 10**4)
    details[base.FocalLengthIn35mmFilm] = stamp.focal_35mm
    place = exif.get_ifd(ExifTags.IFD.GPSInfo)
    place[gps.GPSLatitudeRef], place[gps.GPSLatitude] = "N" if stamp.lat_deg >= 0 else "S", _sexagesimal(stamp.lat_deg)
    place[gps.GPSLongitudeRef], place[gps.GPSLongitude] = (
        "E" if stamp.lon_deg >= 0 else "W",
        _sexagesimal(stamp.lon_deg),
    )
    place[gps.GPSAltitudeRef], place[gps.GPSAltitude] = b"\0", _rational(stamp.alt_m, 10**3)
    return exif


def _sexagesimal(degrees: float) -> tuple[TiffImagePlugin.IFDRational, ...]:
    whole, minutes = divmod(abs(degrees) * 60, 60)
    minutes, seconds = divmod(minutes * 60, 60)
    return (_rational(whole, 1), _rational(minutes, 1), _rational(seconds, 10**5))


def _rational(value: float, denominator: int) -> TiffImagePlugin.IFDRational:
    return TiffImagePlugin.IFDRational(round(value * denominator), denominator)
