"""Pictures at another size: each target pixel is the mean over the area that it covers.

Pixel i covers [i, i + 1), so no content moves, at any ratio. Pillow's BOX counts each pixel whole or not at all.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int, Shaped, UInt8

_ROWS = 16  # of the target at a time: what is in between stays small


def area_mean(
    values: Shaped[np.ndarray, "h w *c"],
    size_px: tuple[int, int],
    crop: tuple[float, float, float, float] | None = None,
) -> Float[np.ndarray, "H W *c"]:
    """Return means over areas of a crop, for a target of this size (width, height).

    crop: (left, top, right, bottom) in source px, within the source; None for all of it.
    """
    (width, height), (high, wide) = size_px, values.shape[:2]
    left, top, right, bottom = crop or (0.0, 0.0, wide, high)
    row, row_part = _parts(top, bottom, height, high)
    column, column_part = _parts(left, right, width, wide)
    per_row = row_part.reshape(*row_part.shape, *[1] * (values.ndim - 1))
    per_column = column_part.reshape(*column_part.shape, *[1] * (values.ndim - 2))
    total = np.empty((height, width, *values.shape[2:]), np.result_type(values.dtype, np.float32))
    for first in range(0, height, _ROWS):
        now = slice(first, first + _ROWS)
        strip = sum(values[row[k, now]] * per_row[k, now] for k in range(len(row)))
        total[now] = sum(np.take(strip, column[k], axis=1) * per_column[k] for k in range(len(column)))
    return total / ((right - left) * (bottom - top) / (width * height))


def shrunk(picture: UInt8[np.ndarray, "h w *c"], size_px: tuple[int, int]) -> UInt8[np.ndarray, "H W *c"]:
    """Return a picture at this size (width, height)."""
    return np.rint(area_mean(picture, size_px)).astype(np.uint8)


def _parts(
    low: float, high: float, count: int, size: int
) -> tuple[Int[np.ndarray, "most n"], Float[np.ndarray, "most n"]]:
    """Return the source pixels that each of `count` target pixels may cover along an axis, and how much of each it does."""
    edges = np.linspace(low, high, count + 1)
    pixels = np.floor(edges[:-1]).astype(int) + np.arange(int(np.ceil((high - low) / count)) + 1)[:, None]
    parts = np.minimum(edges[1:], pixels + 1) - np.maximum(edges[:-1], pixels)
    return np.minimum(pixels, size - 1), np.maximum(parts, 0).astype(np.float32)
