"""Write into a photograph's EXIF where on earth it was taken."""

from __future__ import annotations

import math

from PIL import ExifTags, Image, TiffImagePlugin


def set_place(exif: Image.Exif, lat_deg: float, lon_deg: float, alt_m: float) -> None:
    """Add a position; alt_m may be NaN: then nothing is said of the altitude."""
    tags, place = ExifTags.GPS, exif.get_ifd(ExifTags.IFD.GPSInfo)
    place[tags.GPSLatitudeRef], place[tags.GPSLatitude] = "N" if lat_deg >= 0 else "S", _sexagesimal(lat_deg)
    place[tags.GPSLongitudeRef], place[tags.GPSLongitude] = "E" if lon_deg >= 0 else "W", _sexagesimal(lon_deg)
    if math.isfinite(alt_m):
        place[tags.GPSAltitudeRef] = b"\0" if alt_m >= 0 else b"\1"
        place[tags.GPSAltitude] = rational(abs(alt_m), 10**3)


def rational(value: float, denominator: int) -> TiffImagePlugin.IFDRational:
    """Return a number as EXIF keeps it."""
    return TiffImagePlugin.IFDRational(round(value * denominator), denominator)


def _sexagesimal(degrees: float) -> tuple[TiffImagePlugin.IFDRational, ...]:
    whole, minutes = divmod(abs(degrees) * 60, 60)
    minutes, seconds = divmod(minutes * 60, 60)
    return (rational(whole, 1), rational(minutes, 1), rational(seconds, 10**5))
