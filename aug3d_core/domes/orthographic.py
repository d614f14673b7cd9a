"""Buildings in the surface seen from straight above: a plane slices the heights, and what is above it may be one.

Heights are taken above the ground, which is fitted by least squares, and the slice runs parallel to it through the K-th
percentile of height. (A plane fitted to the points about that percentile alone, as in the paper, is a level one over
level ground; on a slope those points lie on a strip along it and do not tell its tilt.) Of what the slice cuts off, a
building is what is not green, wide enough, and higher than its surroundings on most sides.

Colour tells trees from roofs, not the roughness of the surface: on meshes of photographs crowns come out as smooth as
roofs with their chimneys and steps. So roofs of grass are missed, and a wood without leaves may be taken for a house.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, UInt8
from scipy.ndimage import binary_erosion, binary_fill_holes, binary_opening, gaussian_filter, minimum_filter
from skimage.filters import threshold_otsu
from skimage.measure import label
from skimage.morphology import disk

from aug3d_core.domes.boxes import Buildings, boxes_of
from aug3d_core.domes.height_raster import HeightRaster
from aug3d_core.geometry.ground_model import fit_ground
from aug3d_core.geometry.ground_surface import GroundModel

GREEN = 0.06  # excess green of the palest leaves
BLURRED, OPENED, AROUND = 1 / 8, 1 / 4, 1 / 2  # sizes of neighbourhoods, as shares of the smallest building's side
LOWEST = 1 / 4  # slice, as a share of that side: where nothing stands, the unevenness of the ground would be divided
STANDS_OUT = 0.5  # share of an outline that must drop
DROP = 0.5  # of the height of the slice


@dataclass(frozen=True)
class Slice:
    """What a plane cuts off the surface seen from above."""

    above: Float[np.ndarray, "y x"]  # height above the ground; 0 where there is no surface
    height: float  # of the plane above the ground
    built: Bool[np.ndarray, "y x"]  # above the plane and not green
    side: float  # of the smallest building, in raster squares
    doubts: tuple[str, ...] = ()  # about the heights


def cut(ground: HeightRaster, smallest: float, percentile: float | None, rng: np.random.Generator) -> Slice:
    """Slice the surface at a percentile of its heights above the ground; None: between what is low and what is high.

    Raises InputError where no ground lies under the surface.
    """
    model = fit_ground(ground.points(), rng)
    above = heights_above(model, ground)
    heights = above[ground.covered]
    if percentile is None:
        height = max(dividing_height(heights), LOWEST * smallest)
    else:
        height = float(np.percentile(heights, percentile))
    side = smallest / ground.square
    built = ground.covered & (above > height) & ~green(ground.rgb, BLURRED * side)
    return Slice(above, height, built, side, ground_doubts(model, smallest))


def ground_doubts(model: GroundModel, smallest: float) -> tuple[str, ...]:
    """Say so where the land misses its model by as much as the lowest slice is high, such as on terraces."""
    if model.error <= LOWEST * smallest:
        return ()
    return (
        f"the ground is rougher than its {model.kind} model: they differ by {model.error:.2g} world units, median, so that"
        " banks may pass for buildings and low buildings for ground",
    )


def without_threads(piece: Slice) -> Bool[np.ndarray, "y x"]:
    """Return what is built, with thin links and spikes cut off."""
    return binary_opening(np.pad(piece.built, 1), disk(max(1, round(OPENED * piece.side))))[1:-1, 1:-1]


def buildings_among(parts: Bool[np.ndarray, "y x"], piece: Slice, ground: HeightRaster) -> Buildings:
    """Keep parts that are wide enough and drop on most sides: a bank or terrace is level with what lies uphill."""
    parts = np.asarray(binary_fill_holes(parts))
    reach = 2 * max(1, round(AROUND * piece.side)) + 1
    drops = piece.above - minimum_filter(piece.above, reach, mode="constant") > DROP * piece.height
    rim = parts & np.logical_not(binary_erosion(parts))
    names = np.asarray(label(parts, connectivity=2))
    size, outline, falling = (
        np.bincount(names[squares], minlength=names.max() + 1) for squares in (parts, rim, rim & drops)
    )
    mask = parts & ((size >= piece.side**2) & (falling >= STANDS_OUT * outline))[names]
    boxes = boxes_of(mask, ground.low, ground.square)
    return Buildings(mask, boxes, ground.covered, ground.rgb, ground.low, ground.square)


def heights_above(model: GroundModel, ground: HeightRaster) -> Float[np.ndarray, "y x"]:
    """Return how high the surface stands above the fitted ground; 0 where there is none."""
    points = ground.points()
    above = np.zeros(ground.height.shape)
    above[ground.covered] = points[:, 2] - model.height_at(points[:, :2])
    return above


def dividing_height(heights: Float[np.ndarray, " n"]) -> float:
    """Return the height that best divides low from high ones (Otsu 1979).

    Square roots are divided: roofs differ by metres among each other, the ground by decimetres, and the method wants
    both kinds to vary alike.
    """
    root = np.sqrt(heights.clip(0))
    return float(threshold_otsu(root)) ** 2 if np.ptp(root) > 0 else float(root[0]) ** 2


def green(rgb: UInt8[np.ndarray, "y x 3"], blur: float) -> Bool[np.ndarray, "y x"]:
    """Tell where leaves are: by excess green, 2g - r - b of the shares of colours (Woebbecke et al. 1995)."""
    r, g, b = np.moveaxis(rgb.astype(float), 2, 0)
    excess = (2 * g - r - b) / np.maximum(r + g + b, 1)
    return gaussian_filter(excess, blur) > GREEN
