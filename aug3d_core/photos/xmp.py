"""What a drone writes beside EXIF: where its camera looked, and how high it was above the place where it took off.

Read from the XMP of DJI and of Autel, which writes other names. Nothing here is trusted; what is missing or no number is NaN.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from PIL import Image

_MOST_BYTES = 2**18  # of a packet that is looked at
_NAMES = {
    "yaw_deg": ("drone-dji:GimbalYawDegree", "Camera:Yaw"),
    "pitch_deg": ("drone-dji:GimbalPitchDegree", "Camera:Pitch"),
    "above_start_m": ("drone-dji:RelativeAltitude", "drone:RelativeAltitude"),
}
_LARGEST = {"yaw_deg": 360.0, "pitch_deg": 180.0, "above_start_m": 10_000.0}


@dataclass(frozen=True)
class Attitude:
    """Where a camera looked. yaw_deg: clockwise from north. pitch_deg: 0 level, -90 straight down. NaN if unknown."""

    yaw_deg: float = math.nan
    pitch_deg: float = math.nan
    above_start_m: float = math.nan


def read_attitude(image: Image.Image) -> Attitude:
    """Read an opened photograph's XMP, without decoding it."""
    packet = image.info.get("xmp")
    packet = packet[:_MOST_BYTES] if isinstance(packet, bytes) else b""
    return Attitude(**{field: _number(packet, field) for field in _NAMES})


def _number(packet: bytes, field: str) -> float:
    """Return the number of a field, which stands as an attribute or as an element."""
    for name in _NAMES[field]:
        found = re.search(name.encode() + rb'\s*(?:=\s*["\']|>)\s*([+-]?\d{1,6}(?:\.\d{1,9})?)\s*["\'<]', packet)
        if found and abs(value := float(found[1])) <= _LARGEST[field]:
            return value
    return math.nan
