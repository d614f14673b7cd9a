"""How large a piece of ground a view sees, and how far apart the pieces of two views lie, in their own size."""

from __future__ import annotations

import numpy as np
import pandas as pd
from jaxtyping import Float, Int
from scipy.spatial.distance import cdist

from aug3d_core.geometry.views import Tracks

_SIDE_OVER_MEDIAN = np.sqrt(2 * np.pi)  # side of a square over the radius of the disc that holds half of it


def footprints(
    tracks: Tracks, xyz: Float[np.ndarray, "p 3"], look_in_world: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, " n"]:
    """Return the side of the square of ground that each view sees, in world units.

    It is what a square that is seen evenly would have, judged by the median distance of the seen points from where the
    view looks, so that a few far points do not count. A view that sees none gets the median of the others.
    """
    away = np.linalg.norm(xyz[tracks.point, :2] - look_in_world[tracks.view], axis=1)
    median = pd.Series(away).groupby(tracks.view).median().reindex(range(len(look_in_world)))
    return _SIDE_OVER_MEDIAN * median.fillna(median.median()).to_numpy()


def footprints_apart(
    look_in_world: Float[np.ndarray, "n 2"],
    footprint: Float[np.ndarray, " n"],
    views: Int[np.ndarray, " m"],
    others: Int[np.ndarray, " o"],
) -> Float[np.ndarray, "m o"]:
    """Return the distance between where views and others look, in the mean footprint of the two.

    At 1, two squares of ground side by side touch and do not overlap.
    """
    distance = cdist(look_in_world[views], look_in_world[others])
    size = (footprint[views][:, None] + footprint[others]) / 2
    return distance / np.maximum(size, np.finfo(float).tiny)
