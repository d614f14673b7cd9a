"""Read the uncompressed multi-part OpenEXR files that Blender writes.

Blender offers no other way to get the float colour and depth of a render without a display and without a compositor, and
loading its own file back through `bpy.data.images` flattens the parts. The format: https://openexr.com/en/latest/OpenEXRFileLayout.html.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float32

_MAGIC = 20000630
_MULTI_PART = 0x1000
_FLOAT = 2


@dataclass(frozen=True)
class _Part:
    channels: list[str]  # in file order, which is alphabetical
    width: int
    height: int


def read_exr(path: Path) -> dict[str, Float32[np.ndarray, "h w"]]:
    """Return every channel by its full name (`ViewLayer.Combined.R`)."""
    data = path.read_bytes()
    magic, version = struct.unpack_from("<II", data)
    if magic != _MAGIC or not version & _MULTI_PART:
        raise ValueError(f"{path} is not a multi-part OpenEXR file")
    parts, at = _headers(data, 8)
    images: dict[str, np.ndarray] = {}
    for part in parts:
        start = struct.unpack_from("<Q", data, at)[0]
        at += 8 * part.height
        images |= _pixels(data, start, part)
    return images


def _headers(data: bytes, at: int) -> tuple[list[_Part], int]:
    parts = []
    while data[at]:
        attributes = {}
        while data[at]:
            name, at = _text(data, at)
            _kind, at = _text(data, at)
            size = struct.unpack_from("<i", data, at)[0]
            attributes[name] = data[at + 4 : at + 4 + size]
            at += 4 + size
        at += 1
        parts.append(_part(attributes))
    return parts, at + 1


def _part(attributes: dict[str, bytes]) -> _Part:
    if attributes["compression"] != b"\0":
        raise ValueError("only uncompressed OpenEXR is read")
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    return _Part(_channels(attributes["channels"]), x1 - x0 + 1, y1 - y0 + 1)


def _channels(data: bytes) -> list[str]:
    names, at = [], 0
    while data[at]:
        name, at = _text(data, at)
        if struct.unpack_from("<i", data, at)[0] != _FLOAT:
            raise ValueError(f"OpenEXR channel {name} is not 32-bit float")
        names.append(name)
        at += 16
    return names


def _pixels(data: bytes, start: int, part: _Part) -> dict[str, np.ndarray]:
    row = np.dtype([("head", "<i4", 3), ("values", "<f4", (len(part.channels), part.width))])
    rows = np.frombuffer(data, dtype=row, count=part.height, offset=start)["values"]
    return {name: rows[:, i].copy() for i, name in enumerate(part.channels)}


def _text(data: bytes, at: int) -> tuple[str, int]:
    end = data.index(0, at)
    return data[at:end].decode(), end + 1
