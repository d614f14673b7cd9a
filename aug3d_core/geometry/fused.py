"""Fused points of depth maps as plain arrays, and their file."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, fields
from pathlib import Path
from typing import cast

import numpy as np
from jaxtyping import Float, UInt8
from numpy.lib import format as npy

from aug3d_core.geometry.views import _Arrays


@dataclass(frozen=True)
class Fused(_Arrays):
    """Oriented, coloured points in the world frame."""

    xyz: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]  # unit, towards the cameras
    rgb: UInt8[np.ndarray, "n 3"]
    views: UInt8[np.ndarray, " n"]  # how many photos agreed

    @classmethod
    def count(cls, path: Path) -> int:
        """Return how many points `save` wrote, without reading them."""
        with zipfile.ZipFile(path) as arrays, arrays.open("xyz.npy") as member:
            return _head(cast(zipfile.ZipExtFile, member))[0][0]

    @classmethod
    def parts(cls, path: Path, points: int) -> Iterator[Fused]:
        """Yield what `save` wrote, so many points at a time: memory does not grow with the file."""
        with zipfile.ZipFile(path) as arrays, ExitStack() as opened:
            members = [opened.enter_context(arrays.open(f"{field.name}.npy")) for field in fields(cls)]
            files = cast(list[zipfile.ZipExtFile], members)
            heads = [_head(file) for file in files]
            for first in range(0, heads[0][0][0], points):
                yield cls(*(_rows(file, first, points, *head) for file, head in zip(files, heads, strict=True)))


def _head(file: zipfile.ZipExtFile) -> tuple[tuple[int, ...], np.dtype]:
    """Return shape and type of the array that a file begins with; raises ValueError if it is not written row by row."""
    npy.read_magic(file)
    shape, by_columns, kind = npy.read_array_header_1_0(file)
    if by_columns and len(shape) > 1:
        raise ValueError("points are stored by columns: only the whole file can be read")
    return shape, kind


def _rows(file: zipfile.ZipExtFile, first: int, most: int, shape: tuple[int, ...], kind: np.dtype) -> np.ndarray:
    part = (min(most, shape[0] - first), *shape[1:])
    return np.frombuffer(file.read(int(np.prod(part)) * kind.itemsize), kind).reshape(part)
