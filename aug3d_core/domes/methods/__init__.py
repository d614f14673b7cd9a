"""The ways to choose where domes stand, by name; each is `plan(surface, site, config, rng) -> Plan`.

grid        domes over cells of several sizes
buildings   domes over buildings, alone and in groups
sam         the same, with outlines by Segment Anything
sam_job     what is asked of sam_worker
sam_worker  the process that outlines (torch)
spiral      the whole scene from a spiral: a baseline
scene_dome  the whole scene from one dome: a baseline
"""

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
