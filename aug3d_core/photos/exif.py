"""Read what the camera wrote into a photograph: focal length, position, time, orientation.

Nothing here is trusted: cameras write zeros, NaN, padding and stale sizes, and each of them means "unknown".
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from PIL import ExifTags, Image

_MM_PER_UNIT = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}  # FocalPlaneResolutionUnit
_FIRST_YEAR, _LAST_YEAR = 1900, 2200  # a year outside is damage, and some tables cannot hold it
_FULL_FRAME_DIAGONAL_MM = math.hypot(36.0, 24.0)
_UNNAMED = "unknown"
_WIDEST_SENSOR = 1.55  # aspect above which a frame is a full-width crop of a 4:3 sensor, not a sensor's own shape


@dataclass(frozen=True)
class Exif:
    """What a photograph says of itself; NaN or None where it says nothing usable.

    focal_px: at the stored size of the photograph. focal_source: focal_plane, 35mm or none. orientation: as found.
    """

    camera: str
    focal_px: float
    focal_source: str
    lat_deg: float
    lon_deg: float
    alt_m: float
    time: datetime | None
    orientation: int

    @property
    def silent(self) -> bool:
        """Whether it says nothing that only a camera knows."""
        unnamed = self.camera.startswith(f"{_UNNAMED} ")
        return unnamed and self.time is None and self.focal_source == "none" and math.isnan(self.lat_deg)


def read_exif(image: Image.Image, stored_size: tuple[int, int]) -> Exif:
    """Read an opened photograph's EXIF. Pillow decodes a PNG for it. stored_size: width and height in px, before any draft."""
    exif = image.getexif()
    detail = exif.get_ifd(ExifTags.IFD.Exif)
    focal_px, focal_source = _focal(detail, stored_size)
    lat_deg, lon_deg, alt_m = _position(exif.get_ifd(ExifTags.IFD.GPSInfo))
    orientation = exif.get(ExifTags.Base.Orientation, 1)
    return Exif(
        camera=_camera(exif, detail, stored_size),
        focal_px=focal_px,
        focal_source=focal_source,
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        alt_m=alt_m,
        time=_time(exif, detail),
        orientation=orientation if isinstance(orientation, int) and 1 <= orientation <= 8 else 1,
    )


def _focal(detail: Any, size: tuple[int, int]) -> tuple[float, str]:
    for focal_px, source in ((_focal_plane(detail, size), "focal_plane"), (_focal_35mm(detail, size), "35mm")):
        if 0.2 < focal_px / max(size) < 20:
            return focal_px, source
    return math.nan, "none"


def _focal_plane(detail: Any, size: tuple[int, int]) -> float:
    """Focal length from mm and pixels per unit of the sensor.

    The resolution counts pixels of the photograph as taken, whose size EXIF's PixelXDimension still states after
    downscaling; a crop (another aspect) makes both useless.
    """
    original = _number(detail.get(ExifTags.Base.ExifImageWidth)), _number(detail.get(ExifTags.Base.ExifImageHeight))
    if not all(side > 0 for side in original):
        original = size
    long_side, short_side = max(original), min(original)
    if abs(long_side / short_side * min(size) / max(size) - 1) > 0.02:
        return math.nan
    mm_per_unit = _MM_PER_UNIT.get(detail.get(ExifTags.Base.FocalPlaneResolutionUnit, 2), math.nan)
    pixels_per_mm = _number(detail.get(ExifTags.Base.FocalPlaneXResolution)) / mm_per_unit
    return _number(detail.get(ExifTags.Base.FocalLength)) * pixels_per_mm * max(size) / long_side


def _focal_35mm(detail: Any, size: tuple[int, int]) -> float:
    """Focal length from its 35 mm equivalent, which compares diagonals (CIPA DC-008).

    Frames wider than a sensor's own shape (16:9 from a 4:3 sensor) keep its full width, and the tag keeps its diagonal.
    """
    long_side, short_side = max(size), min(size)
    if long_side / short_side > _WIDEST_SENSOR:
        short_side = long_side * 3 / 4
    equivalent_mm = _number(detail.get(ExifTags.Base.FocalLengthIn35mmFilm))
    return equivalent_mm / _FULL_FRAME_DIAGONAL_MM * math.hypot(long_side, short_side)


def _position(gps: Any) -> tuple[float, float, float]:
    """Latitude and longitude in degrees, altitude in metres; all NaN without a position, altitude alone may be NaN."""
    lat_deg = _degrees(gps.get(ExifTags.GPS.GPSLatitude), _begins(gps.get(ExifTags.GPS.GPSLatitudeRef), "S"))
    lon_deg = _degrees(gps.get(ExifTags.GPS.GPSLongitude), _begins(gps.get(ExifTags.GPS.GPSLongitudeRef), "W"))
    # Cameras without a fix write exactly (0, 0).
    if not (abs(lat_deg) <= 90 and abs(lon_deg) <= 180) or lat_deg == lon_deg == 0:
        return math.nan, math.nan, math.nan
    below_sea = gps.get(ExifTags.GPS.GPSAltitudeRef) in (1, b"\x01")
    alt_m = _number(gps.get(ExifTags.GPS.GPSAltitude))
    return lat_deg, lon_deg, -alt_m if below_sea else alt_m


def _begins(reference: Any, letter: str) -> bool:
    """Tell whether a hemisphere is this one; cameras pad the letter, spell it out ("South") or store it as bytes."""
    text = reference.decode("ascii", "ignore") if isinstance(reference, bytes) else reference
    return _text(text).upper().startswith(letter)


def _degrees(parts: Any, negative: bool) -> float:
    if not isinstance(parts, tuple | list) or len(parts) != 3:
        return math.nan
    degrees = sum(_number(part) / 60**power for power, part in enumerate(parts))
    return -degrees if negative else degrees


def _time(exif: Any, detail: Any) -> datetime | None:
    for value in (detail.get(ExifTags.Base.DateTimeOriginal), exif.get(ExifTags.Base.DateTime)):
        try:
            time = datetime.strptime(_text(value), "%Y:%m:%d %H:%M:%S")
            if not _FIRST_YEAR <= time.year <= _LAST_YEAR:
                continue
        except ValueError:
            continue
        fraction = _text(detail.get(ExifTags.Base.SubsecTimeOriginal))
        return time + timedelta(seconds=float(f"0.{fraction}")) if re.fullmatch(r"[0-9]+", fraction) else time
    return None


def _camera(exif: Any, detail: Any, size: tuple[int, int]) -> str:
    """Name the camera by make, model, serial number, size and the lens's focal length."""
    focal_mm = _number(detail.get(ExifTags.Base.FocalLength))
    make, model = _text(exif.get(ExifTags.Base.Make)), _text(exif.get(ExifTags.Base.Model)) or _UNNAMED
    parts = [
        "" if model.lower().startswith(make.lower()) else make,  # Canon writes it there, too
        model,
        _text(detail.get(ExifTags.Base.BodySerialNumber)),
        f"{size[0]}x{size[1]}",
        f"{focal_mm:g}mm" if focal_mm > 0 else "",
    ]
    return " ".join(part for part in parts if part)


def _text(value: Any) -> str:
    return " ".join(value.replace("\0", " ").split()) if isinstance(value, str) else ""


def _number(value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return math.nan
    return number if math.isfinite(number) else math.nan
