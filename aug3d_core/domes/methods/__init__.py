"""The ways to choose where domes stand, by name; each is `plan(surface, site, config, rng) -> Plan`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from aug3d_core.domes.cameras import Plan
from aug3d_core.domes.config import SamplingConfig
from aug3d_core.domes.methods import buildings, grid, sam, scene_dome, spiral
from aug3d_core.domes.site import Site
from aug3d_core.geometry.raycast import Raycaster

Planner = Callable[[Raycaster, Site, SamplingConfig, np.random.Generator], Plan]

METHODS: dict[str, Planner] = {
    "spiral": spiral.plan,
    "dome": scene_dome.plan,
    "grid": grid.plan,
    "buildings": buildings.plan,
    "sam": sam.plan,
}
