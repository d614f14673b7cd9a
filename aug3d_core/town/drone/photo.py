"""The JPEG that the drone's camera writes: sensor noise, and EXIF with time, focal length and GPS."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from PIL import ExifTags, Image

from aug3d_core.run.atomic_file import replacing
from aug3d_core.run.place_in_exif import rational, set_place

_QUALITY = 92
_SENSOR_DIAGONAL_MM = 7.7


@dataclass(frozen=True)
class Stamp:
    """What the camera knows about a photograph: its focal length as on 35 mm film, if it does, and its place, if it does.

    place: latitude, longitude (degrees) and altitude (m).
    """

    time: datetime
    focal_35mm: int | None
    place: tuple[float, float, float] | None


def save_photo(
    path: Path, rgb: UInt8[np.ndarray, "h w 3"], stamp: Stamp, noise_levels: float, rng: np.random.Generator
) -> None:
    """Write a photograph in one piece, with the sensor's noise; the bytes depend on the arguments alone."""
    noisy = rgb + rng.normal(0, noise_levels, rgb.shape)
    image = Image.fromarray(np.rint(np.clip(noisy, 0, 255)).astype(np.uint8))
    with replacing(path, path.with_suffix(".part")) as file:
        image.save(file, format="JPEG", quality=_QUALITY, subsampling=0, exif=_exif(stamp))


def _exif(stamp: Stamp) -> Image.Exif:
    base = ExifTags.Base
    time = stamp.time.strftime("%Y:%m:%d %H:%M:%S")
    exif = Image.Exif()
    exif[base.Make], exif[base.Model], exif[base.Orientation], exif[base.DateTime] = "aug3d", "Testbed", 1, time
    details = exif.get_ifd(ExifTags.IFD.Exif)
    details[base.DateTimeOriginal] = time
    if stamp.focal_35mm is not None:
        details[base.FocalLength] = rational(stamp.focal_35mm / 43.27 * _SENSOR_DIAGONAL_MM, 10**4)
        details[base.FocalLengthIn35mmFilm] = stamp.focal_35mm
    if stamp.place is not None:
        set_place(exif, *stamp.place)
    return exif
