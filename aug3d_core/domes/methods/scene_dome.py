"""One dome over the whole scene: as object-centric captures are made. A baseline: over a large scene it is too far away.

Every group of views looks at the scene's middle from a sector of its own.
"""

from __future__ import annotations

import numpy as np

from aug3d_core.domes.cameras import Plan
from aug3d_core.domes.config import SamplingConfig
from aug3d_core.domes.place import dome_over, plan_of
from aug3d_core.domes.site import Site
from aug3d_core.geometry.raycast import Raycaster


def plan(surface: Raycaster, site: Site, config: SamplingConfig, rng: np.random.Generator) -> Plan:
    """Plan as many groups of cameras over the whole scene as domes are wanted."""
    side, middle = float(site.ground.extent.max()), site.ground.low + site.ground.extent / 2
    return plan_of(
        (dome_over(surface, site, config, rng, middle, side, "the whole scene") for _ in range(config.domes)), site
    )
