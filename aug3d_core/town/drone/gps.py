"""What the GPS says of where photographs were taken."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from aug3d_core.geometry.geodesy import geodetic_from_enu
from aug3d_core.town.config import TownConfig

ORIGIN_GEODETIC = (46.9, 7.5, 540.0)  # the world's origin: latitude, longitude (degrees), altitude (m); open country


def measured_places(
    config: TownConfig, true_centres: Float[np.ndarray, "n 3"], rng: np.random.Generator
) -> Float[np.ndarray, "n 3"] | None:
    """Return latitude, longitude (degrees) and altitude (m) as measured, or None for a flight without GPS."""
    measured = true_centres + rng.normal(0, config.gps_noise_m, true_centres.shape)
    n = len(measured)
    wrong = rng.permutation(n) < round(config.gps_gross_share * n)
    way = rng.uniform(0, 2 * np.pi, n)
    measured[wrong, :2] += config.gps_gross_m * np.stack([np.cos(way), np.sin(way)], axis=1)[wrong]
    measured[:, 2] += config.gps_altitude_off_m
    return geodetic_from_enu(measured, np.array(ORIGIN_GEODETIC)) if config.gps else None
