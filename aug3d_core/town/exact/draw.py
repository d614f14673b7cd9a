"""Towns without number: what a model is to meet in training so that no place is new to it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from aug3d_core.town.config import TownConfig
from aug3d_core.town.exact.config import ExactTownConfig

# Each with how often it is drawn
_BUILDINGS = {"mixed": 6, "suburb": 3, "dense": 5, "industry": 2, "high_rise": 3, "identical": 1}
_TERRAIN = {"hills": 10, "slope": 6, "terraces": 4}
_SEASONS = {"summer": 9, "dry": 4, "autumn": 4, "winter": 3}
_PATHS = {"lawnmower": 5, "nadir": 3, "crossed": 3, "oblique": 4, "free": 4, "orbit": 1}
_MOST_PHOTOS = 32


def drawn_town(seed: int, number: int, width_px: int) -> ExactTownConfig:
    """Return the town of a number: of two numbers neither tells of the other, and more towns leave the first as they are."""
    rng = np.random.default_rng([seed, number])
    altitude_m = float(np.exp(rng.uniform(np.log(38), np.log(120))))
    size_m = np.clip(altitude_m * rng.uniform(2.0, 3.0, 2), 110, 280)
    town = TownConfig(
        seed=int(rng.integers(2**31)),
        length_m=round(float(size_m.max()), 1),
        width_m=round(float(size_m.min()), 1),
        buildings=_one_of(_BUILDINGS, rng),
        terrain=_one_of(_TERRAIN, rng),
        slope_deg=round(rng.uniform(3, 20), 1),
        bare_roofs=bool(rng.random() < 0.1),
        lake=bool(rng.random() < 0.1),
        trees_share=round(rng.uniform(0.2, 1), 2),
        season=_one_of(_SEASONS, rng),
        sun_azimuth_deg=round(rng.uniform(0, 359), 1),
        sun_elevation_deg=round(rng.uniform(18, 75), 1),
        path=_one_of(_PATHS, rng),
        altitude_m=round(altitude_m, 1),
        tilt_deg=round(rng.uniform(0, 25), 1),
        forward_overlap=round(rng.uniform(0.65, 0.85), 2),
        side_overlap=round(rng.uniform(0.5, 0.75), 2),
        max_photos=_MOST_PHOTOS,
        focal_35mm=int(rng.integers(22, 40)),
        width_px=width_px,
        blur_px=round(rng.uniform(0.3, 0.9), 2),
        blur_share=round(rng.uniform(0, 0.4), 2),
        noise_levels=round(rng.uniform(0.5, 4), 2),
        samples=6,
    )
    exposure, white = round(rng.uniform(0, 0.12), 3), round(rng.uniform(0, 0.02), 3)
    return ExactTownConfig(
        town=town, exposure_spread=exposure, white_spread=white, margin_share=round(rng.uniform(0.05, 0.25), 2)
    )


def _one_of(choices: Mapping[str, int], rng: np.random.Generator) -> Any:
    weight = np.array(list(choices.values()), float)
    return str(rng.choice(list(choices), p=weight / weight.sum()))
