"""Where there is evidence for a surface: near points, or in a hole between them that is not too wide."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import distance_transform_edt
from scipy.spatial import KDTree

MAX_CELLS_PER_SIDE = 2048


def supported(
    xyz: Float[np.ndarray, "v 3"], points: Float[np.ndarray, "p 3"], spacing: float, max_gap: float
) -> Bool[np.ndarray, " v"]:
    """Tell which vertices have evidence: within `max_gap` of a point, and inside the points' closed footprint.

    The footprint is the morphological closing of the points seen from above: it fills holes up to `max_gap` wide and
    adds nothing around the outside, where Poisson's surface curls up and down.
    """
    near = KDTree(points).query(xyz, distance_upper_bound=max_gap)[0] <= max_gap
    return near & _inside(xyz[:, :2], points[:, :2], spacing, max_gap)


def _inside(xy: np.ndarray, points_xy: np.ndarray, spacing: float, max_gap: float) -> np.ndarray:
    low, high = points_xy.min(axis=0) - max_gap - spacing, points_xy.max(axis=0) + max_gap + spacing
    cell = max(spacing, float((high - low).max()) / MAX_CELLS_PER_SIDE)
    shape = np.ceil((high - low) / cell).astype(int) + 1
    empty = np.ones(shape, bool)
    empty[tuple(((points_xy - low) / cell).astype(int).T)] = False
    radius = max_gap / 2 / cell
    grown = np.asarray(distance_transform_edt(empty)) <= radius
    closed = (
        np.asarray(distance_transform_edt(grown)) > radius - 1.0
    )  # a margin of a cell, so that the rim keeps its own points
    index = np.floor((xy - low) / cell).astype(int)
    valid = ((index >= 0) & (index < shape)).all(axis=1)
    index = index.clip(0, shape - 1)
    return valid & closed[index[:, 0], index[:, 1]]
