"""Read the uncompressed single-part OpenEXR files that Blender writes.

Blender offers no leaner way to get the float colour and depth of a render without a display and without a compositor:
loading its own file back through `bpy.data.images` gives one layer only.
The format: https://openexr.com/en/latest/OpenEXRFileLayout.html.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from jaxtyping import Float32

_MAGIC = 20000630
_OTHER_THAN_SCANLINES = 0x200 | 0x800 | 0x1000  # tiles, deep data, several parts
_FLOAT = 2


def read_exr(path: Path) -> tuple[dict[str, Float32[np.ndarray, "h w"]], dict[str, bytes]]:
    """Return every channel by its full name (`ViewLayer.Combined.R`), and the header's attributes as they are written.

    Raises ValueError for any other kind of file.
    """
    data = path.read_bytes()
    magic, version = struct.unpack_from("<II", data)
    if magic != _MAGIC or version & _OTHER_THAN_SCANLINES:
        raise ValueError(f"{path.name} is not a single-part OpenEXR file of scan lines")
    attributes, at = _header(data, 8)
    if attributes["compression"] != b"\0":
        raise ValueError(f"{path.name} is compressed")
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    names = _channels(attributes["channels"])
    row = np.dtype([("y", "<i4"), ("bytes", "<i4"), ("values", "<f4", (len(names), x1 - x0 + 1))])
    first_row = struct.unpack_from("<Q", data, at)[0]  # the first entry of the table of rows that follows the header
    rows = np.frombuffer(data, dtype=row, count=y1 - y0 + 1, offset=first_row)["values"]
    return {name: rows[:, i].copy() for i, name in enumerate(names)}, attributes


def _header(data: bytes, at: int) -> tuple[dict[str, bytes], int]:
    """Return the attributes and where the header ends."""
    attributes = {}
    while data[at]:
        name, at = _text(data, at)
        _, at = _text(data, at)  # the attribute's type
        size = struct.unpack_from("<i", data, at)[0]
        attributes[name] = data[at + 4 : at + 4 + size]
        at += 4 + size
    return attributes, at + 1


def _channels(data: bytes) -> list[str]:
    """Return channel names in the order in which each row holds them."""
    names, at = [], 0
    while data[at]:
        name, at = _text(data, at)
        if struct.unpack_from("<i", data, at)[0] != _FLOAT:
            raise ValueError(f"OpenEXR channel {name} is not 32-bit float")
        names.append(name)
        at += 16
    return names


def _text(data: bytes, at: int) -> tuple[str, int]:
    end = data.index(0, at)
    return data[at:end].decode(), end + 1
