"""Files of fused points, of which any part is read alone: memory depends on the part, not on the file.

The format is NumPy's: an uncompressed ZIP of `.npy` files, in each of which rows follow one another.
"""

from __future__ import annotations

import struct
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import BinaryIO, cast

import numpy as np
from jaxtyping import Bool, Float
from numpy.lib import format as npy

from aug3d_core.geometry.fused import Fused
from aug3d_core.geometry.ground_tiles import Tile

BLOCK = 1 << 16  # rows that share a box: 1.7 MB, and 900 boxes for 60 million points
# Of a ZIP member's own header: its length but for name and extra field, and where the lengths of these two stand
_HEADER, _LENGTHS = 30, 26


@dataclass(frozen=True)
class _Column:
    """An array of a file: where its rows begin."""

    offset: int
    shape: tuple[int, ...]
    kind: np.dtype

    def rows(self, file: BinaryIO, first: int, last: int) -> np.ndarray:
        """Read the rows from `first` up to `last`, or to the end; raises ValueError if the file is cut off."""
        last = min(last, self.shape[0])
        part = (max(last - first, 0), *self.shape[1:])
        row = int(np.prod(self.shape[1:])) * self.kind.itemsize
        file.seek(self.offset + first * row)
        return np.frombuffer(file.read(part[0] * row), self.kind).reshape(part)


@dataclass(frozen=True)
class StoredPoints:
    """A file that `Fused.save` wrote: its rows are read as they are asked for, so that memory does not grow with it."""

    path: Path
    columns: tuple[_Column, ...]  # in the order of Fused's fields

    @classmethod
    def open(cls, path: Path) -> StoredPoints:
        """Look where the arrays are; raises ValueError if they are not stored row by row, as they are."""
        with zipfile.ZipFile(path) as arrays, path.open("rb") as file:
            return cls(path, tuple(_column(arrays, file, f"{field.name}.npy") for field in fields(Fused)))

    def __len__(self) -> int:
        return self.columns[0].shape[0]

    def xyz(self, first: int, last: int) -> Float[np.ndarray, "p 3"]:
        """Read the positions of the rows from `first` up to `last`, or to the end."""
        with self.path.open("rb") as file:
            return self.columns[0].rows(file, first, last)

    def rows(self, first: int, last: int) -> Fused:
        """Read the rows from `first` up to `last`, or to the end."""
        with self.path.open("rb") as file:
            return Fused(*(column.rows(file, first, last) for column in self.columns))

    def parts(self, points: int) -> Iterator[Fused]:
        """Yield all, so many points at a time."""
        for first in range(0, len(self), points):
            yield self.rows(first, first + points)


@dataclass(frozen=True)
class IndexedPoints:
    """Stored points, and the ground under each block of their rows: what lies over a tile is read without the rest.

    Right for any order of the points. Few blocks are read where neighbours in the file are neighbours on the ground.
    """

    stored: StoredPoints
    low: Float[np.ndarray, "b 2"]  # of x and y; inf in a block where nothing is finite
    high: Float[np.ndarray, "b 2"]

    @classmethod
    def of(cls, stored: StoredPoints) -> IndexedPoints:
        """Read all positions once, and keep the boxes."""
        low, high = [np.zeros((0, 2))], [np.zeros((0, 2))]
        for first in range(0, len(stored), BLOCK):
            xyz = stored.xyz(first, first + BLOCK).astype(np.float64)
            xy = xyz[np.isfinite(xyz).all(axis=1), :2]
            low.append(xy.min(axis=0, initial=np.inf, keepdims=True))
            high.append(xy.max(axis=0, initial=-np.inf, keepdims=True))
        return cls(stored, np.concatenate(low), np.concatenate(high))

    def meeting(self, tile: Tile) -> Bool[np.ndarray, " b"]:
        """Tell which blocks may hold points over a tile."""
        return ((self.low < tile.high) & (self.high >= tile.low)).all(axis=1)

    def over(self, tile: Tile) -> Fused:
        """Read the points over a tile, in their order."""
        found = [self.stored.rows(0, 0)]
        for block in np.flatnonzero(self.meeting(tile)).tolist():
            part = self.stored.rows(block * BLOCK, (block + 1) * BLOCK)
            found.append(part.take(tile.holds(part.xyz)))
        return Fused(*(np.concatenate([getattr(part, field.name) for part in found]) for field in fields(Fused)))


def join_points(parts: Iterable[StoredPoints], path: Path) -> None:
    """Write the points of several files into one, in their order: the bytes that `Fused.save` would write of them all."""
    parts = [*parts]
    count = sum(len(part) for part in parts)
    with zipfile.ZipFile(path, "w") as arrays:
        for number, field in enumerate(fields(Fused)):
            column = parts[0].columns[number]
            with arrays.open(f"{field.name}.npy", "w", force_zip64=True) as member:
                shape = (count, *column.shape[1:])
                npy.write_array_header_1_0(
                    member, {"descr": npy.dtype_to_descr(column.kind), "fortran_order": False, "shape": shape}
                )
                for part in parts:
                    with part.path.open("rb") as file:
                        for first in range(0, len(part), BLOCK):
                            member.write(part.columns[number].rows(file, first, first + BLOCK).tobytes())


def _column(arrays: zipfile.ZipFile, file: BinaryIO, name: str) -> _Column:
    info = arrays.getinfo(name)
    with arrays.open(info) as opened:
        member = cast(zipfile.ZipExtFile, opened)
        npy.read_magic(member)
        shape, by_columns, kind = npy.read_array_header_1_0(member)
        header = member.tell()
    if info.compress_type != zipfile.ZIP_STORED or (by_columns and len(shape) > 1):
        raise ValueError("points are stored by columns, or packed: only the whole file can be read")
    file.seek(info.header_offset + _LENGTHS)
    lengths = struct.unpack("<HH", file.read(4))
    return _Column(info.header_offset + _HEADER + sum(lengths) + header, shape, kind)
