"""Boxes in the ground plane, as rows (west, south, east, north) in world units, and the buildings that they enclose."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, UInt8
from skimage.measure import label, regionprops_table


@dataclass(frozen=True)
class Buildings:
    """Where buildings stand in the surface seen from straight above; rasters as in `height_raster.py`."""

    mask: Bool[np.ndarray, "y x"]
    boxes: Float[np.ndarray, "b 4"]
    covered: Bool[np.ndarray, "y x"]  # where there is surface
    rgb: UInt8[np.ndarray, "y x 3"]
    low: Float[np.ndarray, " 2"]  # world x and y of the raster's south-west corner
    square: float  # side of a raster square, world units

    def save(self, path: Path) -> None:
        """Write the arrays; the bytes depend on the arrays alone."""
        with path.open("wb") as file:
            np.savez(file, **{f.name: getattr(self, f.name) for f in fields(self)})

    @classmethod
    def load(cls, path: Path) -> Buildings:
        """Read what `save` wrote."""
        with np.load(path, allow_pickle=False) as arrays:
            rasters = {name: arrays[name] for name in ("mask", "boxes", "covered", "rgb", "low")}
            return cls(**rasters, square=float(arrays["square"]))


def boxes_of(mask: Bool[np.ndarray, "y x"], low: Float[np.ndarray, " 2"], square: float) -> Float[np.ndarray, "b 4"]:
    """Return the box of each connected part of a raster mask; parts that touch at a corner are one."""
    limits = regionprops_table(label(mask, connectivity=2), properties=("bbox",))  # first row and column, last + 1
    return np.stack([limits[f"bbox-{i}"] for i in (1, 0, 3, 2)], axis=1) * square + np.tile(low, 2)


def merged(boxes: Float[np.ndarray, "b 4"], most: int) -> Float[np.ndarray, "g 4"]:
    """Return each box merged with its nearest one, with its two nearest, and so on up to `most`; no result twice.

    The distance of two boxes is the gap between them; of several that touch, the one with the nearer middle is first.
    """
    if len(boxes) < 2 or most < 1:
        return np.zeros((0, 4))
    middle = (boxes[:, :2] + boxes[:, 2:]) / 2
    apart = np.maximum(boxes[:, None, :2] - boxes[None, :, 2:], boxes[None, :, :2] - boxes[:, None, 2:]).clip(0)
    gap, reach = np.linalg.norm(apart, axis=2), np.linalg.norm(middle[:, None] - middle, axis=2)
    np.fill_diagonal(reach, -1.0)  # a box is its own nearest
    nearest = np.lexsort((reach, gap), axis=1)[:, : most + 1]
    together = [boxes[nearest[:, : count + 1]] for count in range(1, nearest.shape[1])]
    groups = np.concatenate([np.hstack([b[..., :2].min(axis=1), b[..., 2:].max(axis=1)]) for b in together])
    return groups[np.sort(np.unique(groups, axis=0, return_index=True)[1])]


def overlap(a: Float[np.ndarray, "n 4"], b: Float[np.ndarray, "m 4"]) -> Float[np.ndarray, "n m"]:
    """Return the intersection over union of all pairs."""
    low, high = np.maximum(a[:, None, :2], b[None, :, :2]), np.minimum(a[:, None, 2:], b[None, :, 2:])
    both = (high - low).clip(0).prod(axis=2)
    area_a, area_b = ((boxes[:, 2:] - boxes[:, :2]).prod(axis=1) for boxes in (a, b))
    return both / (area_a[:, None] + area_b - both)
