"""How near and far, how low and high each photograph sees, from its sparse points. Plain numpy."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from aug3d_core.geometry.transforms import apply, centres

_OUTLIERS_PCT = 0.5
_MARGIN = 0.1  # of the span, on either side; what sparse points miss altogether, the quick look of `search` finds
_LEAST_SPAN = 0.02  # of the distance: flat ground still has kerbs and hedges


def depth_and_height_ranges(
    cam_from_world: Float[np.ndarray, "3 4"], xyz: Float[np.ndarray, "p 3"]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return (nearest, farthest) depth along z and (lowest, highest) height of the points that a view sees, with a margin.

    The highest is kept below the camera, for planes above it are not looked down upon.
    """
    depth = apply(cam_from_world, xyz)[:, 2]
    depth = depth[depth > 0]
    middle = float(np.median(depth))
    near_inverse, far_inverse = _widened(1 / depth, _LEAST_SPAN / middle)[::-1]
    lowest, highest = _widened(xyz[:, 2], _LEAST_SPAN * middle)
    height = float(centres(cam_from_world)[2])
    nearest = 1 / near_inverse
    return (nearest, 1 / max(far_inverse, near_inverse * 1e-2)), (lowest, min(highest, height - 0.5 * nearest))


def _widened(values: Float[np.ndarray, " n"], least_span: float) -> tuple[float, float]:
    low, high = np.percentile(values, [_OUTLIERS_PCT, 100 - _OUTLIERS_PCT])
    margin = _MARGIN * max(high - low, least_span)
    return float(low - margin), float(high + margin)
