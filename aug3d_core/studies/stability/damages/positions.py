"""Damage to the positions in the photo table, as GPS would have it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float

from aug3d_core.geometry.geodesy import enu_from_geodetic, geodetic_from_enu
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.studies.stability.positions_off import scattered, thrown

_COLUMNS = ["lat_deg", "lon_deg", "alt_m"]


def scatter(folder: Path, dose: float, rng: np.random.Generator) -> None:
    """Add noise of `dose` metres on each axis."""
    _move(folder, lambda at_m: scattered(at_m, dose, rng))


def throw(folder: Path, dose: float, rng: np.random.Generator) -> None:
    """Move this share of the positions 100 m away."""
    _move(folder, lambda at_m: thrown(at_m, dose, rng))


def _move(folder: Path, change: Callable[[Float[np.ndarray, "n 3"]], Float[np.ndarray, "n 3"]]) -> None:
    table = pd.read_parquet(folder / PHOTO_TABLE)
    geodetic = table[_COLUMNS].to_numpy(float)
    origin = geodetic.mean(axis=0)
    moved = geodetic_from_enu(change(enu_from_geodetic(geodetic, origin)), origin)
    table.assign(**dict(zip(_COLUMNS, moved.T, strict=True))).to_parquet(folder / PHOTO_TABLE)
