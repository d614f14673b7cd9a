"""Domes over cells of several sizes: few large ones, more small ones.

The sizes come from how high the scene stands in relation to its width and length. A dome over a cell that is much wider
than things are high sees next to no parallax (a homography explains its views), one over a cell that is no wider than
things are high sees a single roof or wall. So cells are from FINEST to COARSEST times the relief wide: a large flat
scene gets many cells across, a small or tall one few. No cell is smaller than what the finest view that the photos
justify shows, none larger than the scene; between these there are two sizes at least, because a model that knows one
scale alone overfits to it.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from aug3d_core.domes.cameras import Plan
from aug3d_core.domes.config import SamplingConfig
from aug3d_core.domes.height_raster import HeightRaster
from aug3d_core.domes.place import Placed, covered_share, dome_over, looked_at, plan_of
from aug3d_core.domes.site import Site
from aug3d_core.geometry.raycast import Raycaster

FINEST, COARSEST = 2.0, 8.0  # sides of cells over the relief
STEPS_TRIED = 120
CLOSEST = 0.1  # least distance of neighbouring cells over their side


def plan(surface: Raycaster, site: Site, config: SamplingConfig, rng: np.random.Generator) -> Plan:
    """Plan the cameras of all domes; cells that cannot have one are in the answer with the reason.

    The domes wanted are shared equally among the scales; what a coarse one has no room for goes to the finer ones.
    """
    placed: list[Placed] = []
    scales = choose_scales(site)
    for rest, side in zip(range(len(scales), 0, -1), scales, strict=True):
        wanted = round((config.domes - sum(dome.views > 0 for dome, _ in placed)) / rest)
        if wanted > 0:
            centres = cell_centres(site.ground, side, choose_step(site, config, side, wanted))
            what = f"cell of {side:.4g}"
            placed += [dome_over(surface, site, config, rng, centre, side, what) for centre in centres]
    return plan_of(placed, site)


def choose_scales(site: Site) -> tuple[float, ...]:
    """Return the sides of cells (world units), largest first, each twice the next."""
    room = float(site.ground.extent.min())
    smallest = min(max(FINEST * site.relief, looked_at(site, 0.0)), room)
    largest = min(max(COARSEST * site.relief, 2 * smallest), room)
    doublings = int(np.log2(largest / smallest) + 1e-6)
    return tuple(smallest * 2.0**k for k in range(doublings, -1, -1))


def choose_step(site: Site, config: SamplingConfig, side: float, wanted: int) -> float:
    """Return the distance of cells (world units) at which the number that can have a dome is nearest to the wanted one.

    At less than their side neighbouring cells overlap, at more there is ground between them.
    """
    steps = np.geomspace(float(site.ground.extent.max()), CLOSEST * side, STEPS_TRIED)
    centres = [cell_centres(site.ground, side, step) for step in steps]
    counts = [(covered_share(site, places, side) >= config.min_cell_covered).sum() for places in centres]
    return float(steps[np.argmin(np.abs(np.array(counts) - wanted))])


def cell_centres(ground: HeightRaster, side: float, step: float) -> Float[np.ndarray, "n 2"]:
    """Return the middles of cells that lie on the ground, row by row from the south-west, centred on it."""
    count = np.floor((ground.extent - side) / step + 1e-6).astype(int).clip(0) + 1
    middle = ground.low + ground.extent / 2
    x, y = (middle[axis] + step * (np.arange(count[axis]) - (count[axis] - 1) / 2) for axis in (0, 1))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
