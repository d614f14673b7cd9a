"""Radial lens distortion: photographs are rendered wider without it, and resampled.

COLMAP's RADIAL model: a ray (x, y, 1) of the camera falls on the pixel f (x, y) (1 + k1 r^2 + k2 r^4) + c, with
r^2 = x^2 + y^2; with k2 = 0 it is SIMPLE_RADIAL. The principal point c is the middle of the photograph.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8
from scipy.ndimage import map_coordinates

from aug3d_core.run.errors import InputError
from aug3d_core.town.config import TownConfig

_WIDEST = 3.0  # largest r of a ray: 72 degrees off the axis
_RIM_PX = 3  # for the interpolation at the wide picture's edge


@dataclass(frozen=True)
class Lens:
    """Focal length and picture size in px, and the two coefficients."""

    focal_px: float
    width_px: int
    height_px: int
    k1: float
    k2: float

    @classmethod
    def of(cls, config: TownConfig) -> Lens:
        """Return a town's lens; raises InputError if its picture would fold over at the corners."""
        lens = cls(config.focal_px, config.width_px, config.height_px, config.radial_k1, config.radial_k2)
        corner = np.hypot(lens.width_px, lens.height_px) / 2 / lens.focal_px
        upto = np.linspace(0, _WIDEST, 3001)
        grows = np.minimum.accumulate(1 + 3 * lens.k1 * upto**2 + 5 * lens.k2 * upto**4 > 0)
        if lens._bent(upto[grows]).max() < corner:
            raise InputError(
                f"a lens with radial_k1={lens.k1:g} and radial_k2={lens.k2:g} folds over before the corner of the picture",
                "Use smaller coefficients, or a longer focal_35mm.",
            )
        return lens

    @property
    def bends(self) -> bool:
        """Whether the lens differs from a pinhole."""
        return self.k1 != 0 or self.k2 != 0

    def undistort(self, falls: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n 2"]:
        """Return the rays (x, y) at z = 1 that fall on places, in focal lengths from the middle.

        By Newton's method on the radius.
        """
        wanted = np.linalg.norm(falls, axis=-1, keepdims=True)
        radius = wanted.copy()
        for _ in range(50):
            slope = 1 + 3 * self.k1 * radius**2 + 5 * self.k2 * radius**4
            radius = np.clip(radius - (self._bent(radius) - wanted) / np.maximum(slope, 0.05), 0, _WIDEST)
        return falls * np.where(wanted > 0, radius / np.maximum(wanted, 1e-12), 1.0)

    def wide_size(self) -> tuple[int, int]:
        """Return width and height of the pinhole picture, of the same focal length, that holds every ray of the photo."""
        rays = np.abs(self._pixel_rays()).reshape(-1, 2).max(axis=0)
        width, height = (2 * (int(np.ceil(self.focal_px * r)) + _RIM_PX) for r in rays)
        return width, height

    def resample(self, wide: UInt8[np.ndarray, "wh ww 3"]) -> UInt8[np.ndarray, "h w 3"]:
        """Return the photograph that the lens makes of the pinhole picture, by cubic interpolation."""
        # Pixel centres are at half-integers, array indices at integers.
        at = self._pixel_rays()[..., ::-1] * self.focal_px + np.array(wide.shape[:2]) / 2 - 0.5
        channels = [map_coordinates(wide[..., c].astype(np.float32), np.moveaxis(at, -1, 0), order=3) for c in range(3)]
        return np.rint(np.clip(np.stack(channels, axis=-1), 0, 255)).astype(np.uint8)

    def _bent(self, radius: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        return radius * (1 + self.k1 * radius**2 + self.k2 * radius**4)

    def _pixel_rays(self) -> Float[np.ndarray, "h w 2"]:
        x = (np.arange(self.width_px) + 0.5 - self.width_px / 2) / self.focal_px
        y = (np.arange(self.height_px) + 0.5 - self.height_px / 2) / self.focal_px
        return self.undistort(np.stack(np.meshgrid(x, y), axis=-1))
