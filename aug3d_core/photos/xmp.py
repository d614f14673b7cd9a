"""What a drone writes beside EXIF: where its camera looked, and how high it was above the place where it took off.

Read from XMP: the names of DJI, and those of Pix4D (`Camera:`), which several makers write. Nothing here is trusted; what is
missing, no number or impossible is NaN.

Pix4D's pitch is 0 straight down and 90 level (https://support.pix4d.com/hc/en-us/articles/202558969). Autel wrote it so at
first, and later put DJI's pitch, 0 level and -90 straight down, under the same name
(https://github.com/Theta-Limited/OpenAthenaIOS/issues/62). In its photographs a pitch that is clearly below 0 is DJI's.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from PIL import Image

_MOST_BYTES = 2**18  # of a packet that is looked at
_YAW, _PITCH = "Camera:Yaw", "Camera:Pitch"  # of Pix4D
_NAMES = {
    "yaw_deg": ("drone-dji:GimbalYawDegree", _YAW),
    "pitch_deg": ("drone-dji:GimbalPitchDegree", _PITCH),
    "above_start_m": ("drone-dji:RelativeAltitude", "drone:RelativeAltitude"),
}
_RANGE = {"yaw_deg": (-360.0, 360.0), "pitch_deg": (-135.0, 90.0), "above_start_m": (-10_000.0, 10_000.0)}
_AUTEL = re.compile(rb"autel|\bdrone:", re.IGNORECASE)  # its name, or that of its fields
_BELOW_DEG = -10.0  # a pitch of Autel's below it is none of Pix4D's: cameras hardly look behind the drone


@dataclass(frozen=True)
class Attitude:
    """Where a camera looked. yaw_deg: clockwise from north. pitch_deg: 0 level, -90 straight down. NaN if unknown."""

    yaw_deg: float = math.nan
    pitch_deg: float = math.nan
    above_start_m: float = math.nan


def read_attitude(image: Image.Image) -> Attitude:
    """Read an opened photograph's XMP, without decoding it."""
    packet, exif = _bytes(image.info.get("xmp")), _bytes(image.info.get("exif"))
    autel = _AUTEL.search(packet + exif) is not None
    return Attitude(**{field: _number(packet, field, autel) for field in _NAMES})


def _bytes(told: object) -> bytes:
    return told[:_MOST_BYTES] if isinstance(told, bytes) else b""


def _number(packet: bytes, field: str, autel: bool) -> float:
    """Return the number of a field, which stands as an attribute or as an element."""
    least, most = _RANGE[field]
    for name in _NAMES[field]:
        found = re.search(name.encode() + rb'\s*(?:=\s*["\']|>)\s*([+-]?\d{1,6}(?:\.\d{1,9})?)\s*["\'<]', packet)
        if found is None:
            continue
        value = float(found[1])
        if name == _PITCH and not (autel and value < _BELOW_DEG):
            value -= 90
        if least <= value <= most:
            return value
    return math.nan
