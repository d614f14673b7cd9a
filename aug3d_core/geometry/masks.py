"""Masks of photographs: 8-bit pictures, 255 where a photograph may be used, 0 where not. One without a mask is used whole."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Bool, UInt8
from PIL import Image

from aug3d_core.geometry.area_mean import area_mean

LEAST_USED = 128  # a grey level from which a pixel is used


def used_pixels(path: Path, size_px: Sequence[int] | None = None) -> Bool[np.ndarray, "h w"] | None:
    """Return which pixels are used, at a size (width, height) or the mask's own: those of which half or more is.

    None where there is no mask.
    """
    if not path.exists():
        return None
    with Image.open(path) as image:
        mask = np.asarray(image.convert("L"))
    if size_px is None or mask.shape[::-1] == tuple(size_px):
        return mask >= LEAST_USED
    width, height = size_px
    return np.round(area_mean(mask, (width, height)), 2) >= LEAST_USED - 0.5  # as far as float32 tells a half


def continued(picture: UInt8[np.ndarray, "h w 3"], used: Bool[np.ndarray, "h w"]) -> UInt8[np.ndarray, "h w 3"]:
    """Return a picture in which the nearest used pixel stands for each that is not; one at least has to be used."""
    from scipy.ndimage import distance_transform_edt  # takes 0.17 s, and most processes do without

    row, column = np.asarray(distance_transform_edt(~used, return_distances=False, return_indices=True))
    return picture[row, column]


def save_mask(used: Bool[np.ndarray, "h w"], path: Path) -> None:
    """Write a mask; its folder is made where it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.where(used, np.uint8(255), np.uint8(0))).save(path, compress_level=1)
