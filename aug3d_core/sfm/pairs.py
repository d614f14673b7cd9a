"""Choose the pairs of photographs that are worth comparing."""

from __future__ import annotations

import numpy as np
import pandas as pd
from jaxtyping import Float, Int
from scipy.spatial import KDTree

from aug3d_core.geometry.geodesy import enu_from_geodetic
from aug3d_core.sfm.config import MatchingConfig

_BLOCK = 20
_IN_SEQUENCE = 2


def choose_pairs(photos: pd.DataFrame, config: MatchingConfig) -> tuple[Int[np.ndarray, "m 2"], str]:
    """Return pairs (i < j) of photo ids, and the way they were chosen: `exhaustive` or `gps`.

    Photographs without GPS among many with it are compared with all others.
    """
    enu = gps_positions(photos)[0]
    located = np.isfinite(enu[:, 0])
    if len(photos) <= config.exhaustive_limit or located.mean() < 0.5:
        return exhaustive_pairs(len(photos)), "exhaustive"
    return neighbour_pairs(enu[:, :2], config.neighbours), "gps"


def exhaustive_pairs(count: int) -> Int[np.ndarray, "m 2"]:
    """Return all pairs, block by block, so that the features of few photographs are in use at a time."""
    i, j = np.triu_indices(count, k=1)
    order = np.lexsort((j, i, j // _BLOCK, i // _BLOCK))
    return np.stack([i, j], axis=1)[order]


def neighbour_pairs(positions_m: Float[np.ndarray, "n 2"], neighbours: int) -> Int[np.ndarray, "m 2"]:
    """Return the pairs of each photograph with its nearest ones and with the next ones in capture order.

    A row of NaN is a photograph without a position, paired with all.
    """
    count = len(positions_m)
    located = np.flatnonzero(np.isfinite(positions_m).all(axis=1))
    lost = np.setdiff1d(np.arange(count), located)
    most = min(neighbours + 1, len(located))  # a photograph is its own nearest
    nearest = np.asarray(KDTree(positions_m[located]).query(positions_m[located], k=most)[1])
    steps = range(1, _IN_SEQUENCE + 1)
    sequence = np.concatenate([np.stack([np.arange(count - step), np.arange(step, count)], axis=1) for step in steps])
    pairs = np.concatenate(
        [
            np.stack([np.repeat(located, most), located[nearest.ravel()]], axis=1),
            np.stack([np.repeat(lost, count), np.tile(np.arange(count), len(lost))], axis=1),
            sequence,
        ]
    )
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
    return pairs[pairs[:, 0] < pairs[:, 1]]


def gps_positions(photos: pd.DataFrame) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, " 3"]]:
    """Return ENU metres about the photographs' median position, and that position (lat, lon, alt).

    Rows are NaN without GPS; a missing altitude counts as the median one. The origin is NaN where nothing has GPS.
    """
    geodetic = photos[["lat_deg", "lon_deg", "alt_m"]].to_numpy(float, copy=True)
    located = np.isfinite(geodetic[:, 0])
    if not located.any():
        return np.full_like(geodetic, np.nan), np.full(3, np.nan)
    altitude = geodetic[located, 2]
    median_alt = np.median(altitude[np.isfinite(altitude)]) if np.isfinite(altitude).any() else 0.0
    geodetic[located, 2] = np.where(np.isfinite(altitude), altitude, median_alt)
    origin = np.median(geodetic[located], axis=0)
    return enu_from_geodetic(geodetic, origin), origin
