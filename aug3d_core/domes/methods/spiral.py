"""A spiral over the whole scene, looking at its middle: as object-centric captures are made. A baseline, see scene_dome.

Seen from above it is Archimedean: the distance to the axis grows evenly with the azimuth. Runs of it are the groups.
"""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from aug3d_core.domes.cameras import Plan
from aug3d_core.domes.config import SamplingConfig
from aug3d_core.domes.place import dome_over, plan_of
from aug3d_core.domes.site import Site
from aug3d_core.geometry.raycast import Raycaster

TURNS = 4


def plan(surface: Raycaster, site: Site, config: SamplingConfig, rng: np.random.Generator) -> Plan:
    """Plan as many groups of cameras, one run of the spiral each, as domes are wanted."""
    side, middle = float(site.ground.extent.max()), site.ground.low + site.ground.extent / 2
    runs = np.linspace(0, 1, config.domes + 1)
    return plan_of(
        (
            dome_over(
                surface,
                site,
                config,
                rng,
                middle,
                side,
                "a run of the spiral",
                partial(on_run, start, end, config, rng),
            )
            for start, end in pairwise(runs)
        ),
        site,
    )


def on_run(
    start: float, end: float, config: SamplingConfig, rng: np.random.Generator, count: int
) -> Float[np.ndarray, "n 3"]:
    """Draw unit vectors to cameras on a run of the spiral, given as shares (0 to 1) of its length."""
    # The length of an Archimedean spiral grows with the square of its distance to the axis
    part = np.sqrt(rng.uniform(start, end, count))
    nearest, farthest = np.cos(np.radians([config.max_elevation_deg, config.min_elevation_deg]))
    distance, azimuth = nearest + (farthest - nearest) * part, 2 * np.pi * TURNS * part
    return np.stack([distance * np.cos(azimuth), distance * np.sin(azimuth), np.sqrt(1 - distance**2)], axis=1)
