"""Domes over buildings, alone and in groups: forest and lawn would have most of a grid's domes.

Each building's box is also merged with its nearest boxes, for views of several buildings. Where there is no building,
domes stand over a grid.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from jaxtyping import Bool

from aug3d_core.domes.boxes import Buildings, merged
from aug3d_core.domes.cameras import Plan
from aug3d_core.domes.config import SamplingConfig
from aug3d_core.domes.methods import grid
from aug3d_core.domes.orthographic import Slice, buildings_among, cut, without_threads
from aug3d_core.domes.place import Placed, dome_over, looked_at, plan_of
from aug3d_core.domes.site import Site
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.run.errors import InputError

SMALLEST = 1 / 12  # of what the nearest view shows: less is a speck in it

Outline = Callable[[Slice], Bool[np.ndarray, "y x"]]  # tells which squares may belong to a building


def plan(surface: Raycaster, site: Site, config: SamplingConfig, rng: np.random.Generator) -> Plan:
    """Plan domes over the buildings that a plane cuts off the ground."""
    return plan_over(without_threads, surface, site, config, rng)


def plan_over(
    outline: Outline, surface: Raycaster, site: Site, config: SamplingConfig, rng: np.random.Generator
) -> Plan:
    """Plan domes over single buildings and groups, in random order, until as many stand as are wanted."""
    smallest = SMALLEST * looked_at(site, 0.0)
    try:
        piece = cut(site.ground, smallest, config.slice_percentile, rng)
    except InputError as no_ground:
        note = f"no building can be found, domes stand over a grid: {no_ground.problem}"
        return replace(grid.plan(surface, site, config, rng), notes=(note,))
    found = buildings_among(outline(piece), piece, site.ground)
    if not len(found.boxes):
        note = f"no building is at least {smallest:.3g} wide: domes stand over a grid"
        return replace(grid.plan(surface, site, config, rng), notes=(note, *piece.doubts), buildings=found)
    return replace(_domes(found, surface, site, config, rng), notes=piece.doubts, buildings=found)


def _domes(found: Buildings, surface: Raycaster, site: Site, config: SamplingConfig, rng: np.random.Generator) -> Plan:
    boxes = np.concatenate([found.boxes, merged(found.boxes, config.merged_boxes)])
    # A box fills the view's shorter side however the view is turned
    sides = (boxes[:, 2:] - boxes[:, :2]).max(axis=1) * site.size.max() / site.size.min()
    placed: list[Placed] = []
    for box in rng.permutation(len(boxes)):
        if sum(dome.views > 0 for dome, _ in placed) == config.domes:
            break
        middle = (boxes[box, :2] + boxes[box, 2:]) / 2
        what = "building" if box < len(found.boxes) else "buildings together"
        placed.append(dome_over(surface, site, config, rng, middle, float(sides[box]), what))
    return plan_of(placed, site)
