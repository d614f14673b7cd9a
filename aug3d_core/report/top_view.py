"""The scene seen from above, as pictures that maps of the report lie on.

A map has x (east) to the right and y (north) up; its pixels count from the top left corner.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, UInt8

_CUT = (1.0, 99.0)  # percentiles: a few points far out must not shrink the rest
_NEAR = 0.5  # of the cameras' extent: so far beyond them the map goes at most
_MARGIN = 0.03
_NEIGHBOURS = ((0, 1), (0, -1), (1, 0), (-1, 0))
_FILL_ROUNDS = 2  # pixels between points that are filled from their neighbours


@dataclass(frozen=True)
class Frame:
    """What a map shows: from `low` to `high` in the world, `px` pixels to a unit."""

    low: Float[np.ndarray, " 2"]
    high: Float[np.ndarray, " 2"]
    px: float

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        width, height = np.ceil((self.high - self.low) * self.px).astype(int)
        return max(1, int(width)), max(1, int(height))

    def place(self, in_world: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n 2"]:
        """Return where places of the world lie on the map, in pixels."""
        right, up = np.moveaxis((in_world - self.low) * self.px, -1, 0)
        return np.stack([right, self.size[1] - up], axis=-1)

    def scaled(self, longest_px: int) -> Frame:
        """Return the same piece of the world at another size."""
        return Frame(self.low, self.high, longest_px / max(float((self.high - self.low).max()), 1e-9))


def frame_of(points_in_world: Float[np.ndarray, "p 2"], cameras: Float[np.ndarray, "n 2"], longest_px: int) -> Frame:
    """Return a frame about every camera and nearly all points; what oblique cameras see far away is left out."""
    low, high = cameras.min(axis=0), cameras.max(axis=0)
    if len(points_in_world):
        point_low, point_high = np.percentile(points_in_world, _CUT, axis=0)
        near = _NEAR * (high - low).max() or np.inf
        low = np.minimum(low, np.maximum(point_low, low - near))
        high = np.maximum(high, np.minimum(point_high, high + near))
    pad = _MARGIN * float((high - low).max()) or 1.0
    return Frame(low - pad, high + pad, 1.0).scaled(longest_px)


def from_above(
    xyz: Float[np.ndarray, "p 3"], rgb: UInt8[np.ndarray, "p 3"], frame: Frame
) -> tuple[UInt8[np.ndarray, "h w 4"], Float[np.ndarray, "h w"]]:
    """Return the highest point of each pixel: its colour (transparent where there is none) and its height (NaN)."""
    width, height = frame.size
    column, row = np.floor(frame.place(xyz[:, :2])).astype(int).T
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    order = np.flatnonzero(inside)[np.argsort(xyz[inside, 2], kind="stable")]  # the highest is written last
    colours, heights = np.zeros((height, width, 4), np.uint8), np.full((height, width), np.nan)
    colours[row[order], column[order], :3] = rgb[order]
    colours[row[order], column[order], 3] = 255
    heights[row[order], column[order]] = xyz[order, 2]
    for _ in range(_FILL_ROUNDS):
        colours, heights = _filled(colours, heights)
    return colours, heights


def _filled(
    colours: UInt8[np.ndarray, "h w 4"], heights: Float[np.ndarray, "h w"]
) -> tuple[UInt8[np.ndarray, "h w 4"], Float[np.ndarray, "h w"]]:
    """Give empty pixels the mean of their neighbours, where at least two of the four have something."""
    known = np.isfinite(heights)
    values = np.dstack([colours[..., :3], np.where(known, heights, 0)]) * known[..., None]
    total = np.sum([_shifted(values, *by) for by in _NEIGHBOURS], axis=0)
    count = np.sum([_shifted(known.astype(int), *by) for by in _NEIGHBOURS], axis=0)
    new: Bool[np.ndarray, "h w"] = ~known & (count >= 2)
    mean = total[new] / count[new][:, None]
    colours, heights = colours.copy(), heights.copy()
    colours[new, :3], colours[new, 3], heights[new] = mean[:, :3], 255, mean[:, 3]
    return colours, heights


def _shifted(values: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """Return values moved by so many rows and columns, zero where nothing comes in."""
    moved = np.roll(values, (rows, columns), axis=(0, 1))
    if rows:
        moved[0 if rows > 0 else -1] = 0
    if columns:
        moved[:, 0 if columns > 0 else -1] = 0
    return moved
