"""Depth and normal maps as COLMAP's dense workspace keeps them.

A file is the text `width&height&channels&` and then float32 numbers, little endian: x fastest, then y, then channel.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float32

from aug3d_core.run.atomic_file import replacing
from aug3d_core.run.errors import InputError


def write_map(path: Path, values: Float32[np.ndarray, "h w *c"]) -> None:
    """Write a map of one channel (h, w) or several (h, w, c); it is there whole, or not at all."""
    planes = values if values.ndim == 3 else values[..., None]
    height, width, channels = planes.shape
    with replacing(path, path.with_name(f".{path.name}")) as file:
        file.write(f"{width}&{height}&{channels}&".encode("ascii"))
        file.write(np.ascontiguousarray(planes.transpose(2, 0, 1), "<f4").tobytes())


def read_map(path: Path) -> Float32[np.ndarray, "h w *c"]:
    """Read a map; raises InputError if the file is not one, or is truncated."""
    data = path.read_bytes()
    try:
        *numbers, _ = data[:64].split(b"&", 3)
        width, height, channels = (int(number) for number in numbers)
        start = sum(len(number) + 1 for number in numbers)
        planes = np.frombuffer(data, "<f4", offset=start).reshape(channels, height, width)
    except ValueError as error:
        raise InputError(f"{path} is no whole depth or normal map", "run the depth stage again") from error
    return planes[0].copy() if channels == 1 else planes.transpose(1, 2, 0).copy()
