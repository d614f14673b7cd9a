"""The surface seen from above, as a raster: row along y (south first), column along x (west first)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster

RASTER_PX, MOST_PX = 400, 2500  # along the longer side: finer than any cell of a grid; more where that is asked


@dataclass(frozen=True)
class HeightRaster:
    """Heights and colours of the highest surface at each raster square."""

    height: Float[np.ndarray, "y x"]  # world units; NaN where there is no surface
    rgb: UInt8[np.ndarray, "y x 3"]
    low: Float[np.ndarray, " 2"]  # world x and y of the raster's south-west corner
    square: float  # side of a raster square, world units

    @property
    def covered(self) -> Bool[np.ndarray, "y x"]:
        """Where there is surface."""
        return np.isfinite(self.height)

    @property
    def extent(self) -> Float[np.ndarray, " 2"]:
        """Size along x and y, world units."""
        return np.array(self.height.shape[::-1]) * self.square

    def points(self) -> Float[np.ndarray, "n 3"]:
        """Return the surface at the middle of each square that has any."""
        row, column = np.nonzero(self.covered)
        xy = self.low + self.square * (np.stack([column, row], axis=1) + 0.5)
        return np.column_stack([xy, self.height[row, column]])

    def window(self, centre: Float[np.ndarray, " 2"], side: float) -> Float[np.ndarray, " n"]:
        """Return the heights on a square about a place, as far as the raster goes; NaN where there is no surface."""
        (west, south), (east, north) = (limit[0] for limit in self._window(centre[None], side))
        return self.height[south:north, west:east].ravel()

    def covered_share(self, centres: Float[np.ndarray, "n 2"], side: float) -> Float[np.ndarray, " n"]:
        """Return the share of squares about these places that has surface; beyond the raster there is none."""
        first, last = self._window(centres, side)
        sums = self._sums
        x0, y0, x1, y1 = *first.T, *last.T
        return (sums[y1, x1] - sums[y0, x1] - sums[y1, x0] + sums[y0, x0]) * (self.square / side) ** 2

    @cached_property
    def _sums(self) -> Int[np.ndarray, "y1 x1"]:
        """The summed-area table of `covered`: any window's count in four look-ups."""
        return np.pad(self.covered.astype(np.int64), ((1, 0), (1, 0))).cumsum(axis=0).cumsum(axis=1)

    def _window(self, centres: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the first and last + 1 raster column and row of squares about places, cut to the raster."""
        count = self.height.shape[::-1]
        first = np.rint((centres - side / 2 - self.low) / self.square).astype(int).clip(0, count)
        return first, np.rint((centres + side / 2 - self.low) / self.square).astype(int).clip(first, count)


def height_raster(mesh: Mesh, surface: Raycaster, widest: float = np.inf) -> HeightRaster:
    """Look straight down at a mesh, on squares no wider than this (world units) unless they would be too many."""
    low, high = mesh.xyz.min(axis=0).astype(float), mesh.xyz.max(axis=0).astype(float)
    extent = float((high - low)[:2].max())
    square = max(min(extent / RASTER_PX, widest), extent / MOST_PX)
    count = np.maximum(np.ceil((high - low)[:2] / square - 1e-6).astype(int), 1)
    x, y = (low[axis] + square * (np.arange(count[axis]) + 0.5) for axis in (0, 1))
    top = high[2] + square
    origins = np.stack([*np.meshgrid(x, y), np.full((count[1], count[0]), top)], axis=-1)
    hits = surface.cast(origins, np.array([0.0, 0.0, -1.0]))
    hit = hits.triangle >= 0
    rgb = np.zeros((*hit.shape, 3), np.uint8)
    rgb[hit] = np.einsum("pk,pkc->pc", hits.weights[hit], mesh.rgb[mesh.triangles[hits.triangle[hit]]])
    return HeightRaster(np.where(hit, top - hits.distance, np.nan), rgb, low[:2], square)
