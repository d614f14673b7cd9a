"""Posed views, points and tracks as plain arrays, and their files.

Conventions (the whole project's): world is ENU metres, or z-up scene units when there is no GPS. Cameras are COLMAP's: x
right, y down, z forward. `cam_from_world` maps world points into the camera. Pixel centres are at half-integers, so the
top left pixel spans [0, 1] x [0, 1]. `intrinsics` is (fx, fy, cx, cy) in pixels of a pinhole image.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import BinaryIO, TypeVar

import numpy as np
from jaxtyping import Float, Int, UInt8

# Not typing.Self: beartype, which checks shapes in the tests, refuses it outside a decorated class
_Loaded = TypeVar("_Loaded", bound="_Arrays")


@dataclass(frozen=True)
class _Arrays:
    """A frozen set of named arrays that is one `.npz` file."""

    def save(self, path: Path) -> None:
        """Write the arrays; the bytes depend on the arrays alone."""
        with path.open("wb") as file:
            self.write(file)

    def write(self, file: BinaryIO) -> None:
        """Write the same into an open file."""
        np.savez(file, **{f.name: getattr(self, f.name) for f in fields(self)})

    @classmethod
    def load(cls: type[_Loaded], path: Path) -> _Loaded:
        """Read what `save` wrote; raises if an array is missing. Pickles are refused."""
        with np.load(path, allow_pickle=False) as arrays:
            return cls(**{f.name: arrays[f.name] for f in fields(cls)})


@dataclass(frozen=True)
class Views(_Arrays):
    """Posed pinhole views, undistorted."""

    photo_id: Int[np.ndarray, " n"]
    cam_from_world: Float[np.ndarray, "n 3 4"]
    intrinsics: Float[np.ndarray, "n 4"]  # fx, fy, cx, cy in px
    size: Int[np.ndarray, "n 2"]  # width, height in px

    def __len__(self) -> int:
        return len(self.photo_id)

    def take(self, index: Int[np.ndarray, " m"]) -> Views:
        """Return the chosen views."""
        return Views(**{f.name: getattr(self, f.name)[index] for f in fields(self)})


@dataclass(frozen=True)
class Points(_Arrays):
    """Triangulated points in the world frame."""

    xyz: Float[np.ndarray, "p 3"]
    rgb: UInt8[np.ndarray, "p 3"]
    error_px: Float[np.ndarray, " p"]


@dataclass(frozen=True)
class Tracks(_Arrays):
    """Observations: point `point[t]` is seen by view `view[t]` (an index into Views) at `xy[t]` (undistorted px)."""

    point: Int[np.ndarray, " t"]
    view: Int[np.ndarray, " t"]
    xy: Float[np.ndarray, "t 2"]
