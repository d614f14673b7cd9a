"""The surface through the fused points, without colours: as a whole or, of a large scene, tile by tile and then joined.

A tile is drawn with a margin of its neighbours' points, so that both sides of a border agree about it, and decimated with
that margin too, so that nothing pulls at the border. Only then it is cut to its ground, and joined to its neighbours.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median, median_high

import numpy as np
from jaxtyping import Int

from aug3d_core.geometry.fused import Fused
from aug3d_core.geometry.views import Views
from aug3d_core.run.errors import InputError
from aug3d_core.surface.clip import clip_to
from aug3d_core.surface.clock import Clock
from aug3d_core.surface.colour import ground_sampling
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.surface.decimate import decimate
from aug3d_core.surface.evidence import gather
from aug3d_core.surface.join import join
from aug3d_core.surface.poisson import octree_depth, reconstruct
from aug3d_core.surface.shape import Shape, triangle_areas
from aug3d_core.surface.tiles import EVERYWHERE, MOST_POINTS, Halved, Planned, Tile, leaves, plan_tiles
from aug3d_core.surface.trim import bridged, trim

# Spacings around a tile, at least: Poisson's finest cell is two, and points a few coarser cells away no longer bend it
MARGIN_SPACINGS = 48.0
# Two tiles' surfaces that are nearer at their border are one. Twice as far as a point speaks for a surface: of 16 tiles of the
# demo's town, 1.3 % of the borders' length then stays open by more than 0.05 spacings, and 1.2 % at half of this
JOIN_SPACINGS = 4.0


@dataclass(frozen=True)
class Drawn:
    """A surface and how it came about. Lengths in world units; of several tiles, medians unless they say otherwise."""

    shape: Shape
    points: int  # that it was drawn through
    spacing: float  # of the points
    octree_depth: int
    triangles_full: int  # before decimation
    decimation_error: float  # of the worst tile
    ground_sampling: float  # of the photos on the surface, world units per px
    area: float
    bridged_area: float  # closed gaps, where no point is
    tiles: int


def draw(
    fused: Path,
    views: Views,
    chosen: Int[np.ndarray, " m"],
    config: SurfaceConfig,
    clock: Clock,
    most: int = MOST_POINTS,
) -> Drawn:
    """Draw the surface that stored points support, in tiles if there are more than `most`; raises InputError if none."""
    count = Fused.count(fused)
    if count <= most:
        return _draw(Fused.load(fused), EVERYWHERE, EVERYWHERE, views, chosen, config, clock)
    with clock.step("tiling"):
        plan = plan_tiles(fused, count, most)
    # Of a gap's width: so far points away decide whether a gap that ends at a border is closed
    margin = max(MARGIN_SPACINGS, config.max_gap_spacings)
    drawn, failed = [], None
    for tile in leaves(plan):
        by = margin * tile.spacing
        with clock.step("tiling"):
            points = tile.read(fused, by)
        try:
            drawn.append(_draw(points, tile.ground, tile.ground.grown(by), views, chosen, config, clock))
        except InputError as error:  # water, say: the other tiles may have a surface
            drawn.append(None)
            failed = error
    some = [one for one in drawn if one is not None]
    if not some:
        raise failed or AssertionError
    with clock.step("tiling"):
        shape = _joined(plan, iter(drawn), JOIN_SPACINGS * max(one.spacing for one in some))
    return Drawn(
        shape,
        sum(one.points for one in some),
        median(one.spacing for one in some),
        median_high(one.octree_depth for one in some),
        sum(one.triangles_full for one in some),
        max(one.decimation_error for one in some),
        median(one.ground_sampling for one in some),
        sum(one.area for one in some),
        sum(one.bridged_area for one in some),
        len(drawn),
    )


def _draw(
    fused: Fused,
    ground: Tile,
    read: Tile,
    views: Views,
    chosen: Int[np.ndarray, " m"],
    config: SurfaceConfig,
    clock: Clock,
) -> Drawn:
    """Draw the surface over `ground`, through the points of `read`; raises InputError if there is none."""
    with clock.step("evidence"):
        evidence = gather(fused)
    with clock.step("poisson"):
        raw = reconstruct(evidence, even=read != EVERYWHERE)
    with clock.step("trimming"):
        fine = trim(raw, evidence, config.max_gap_spacings * evidence.spacing, config.min_piece_points, read)
    if not len(fine.triangles):
        raise nothing(f"no surface stands through the {len(evidence.xyz)} fused points")
    sampling = ground_sampling(fine, views, chosen)
    if np.isnan(sampling):
        raise nothing("no photograph frames any of the surface through the fused points")
    with clock.step("decimation"):
        coarse = decimate(fine, config.max_error_gsd * sampling)
    own = ground.holds(fine.xyz[fine.triangles].mean(axis=1))
    area = triangle_areas(fine)[own]
    return Drawn(
        clip_to(coarse.shape, ground),
        int(ground.holds(evidence.xyz).sum()),
        evidence.spacing,
        octree_depth(evidence),
        int(own.sum()),
        coarse.error,
        sampling,
        float(area.sum()),
        float(area[bridged(fine, evidence)[own]].sum()),
        1,
    )


def nothing(problem: str) -> InputError:
    """Return the error of a scene that has no surface."""
    return InputError(
        problem, "take more photos of textured ground with at least 60 % overlap, or use larger working copies"
    )


def _joined(plan: Halved | Planned, drawn: Iterator[Drawn | None], reach: float) -> Shape:
    """Join the tiles in their order, neighbours first."""
    if isinstance(plan, Planned):
        one = next(drawn)
        return Shape(np.zeros((0, 3)), np.zeros((0, 3), np.int32)) if one is None else one.shape
    below = _joined(plan.below, drawn, reach)
    return join(below, _joined(plan.above, drawn, reach), plan, reach)
