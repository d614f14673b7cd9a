"""One mesh from the photographs of the allowed roles alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool

from aug3d_core.errors import InputError
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.surface.colour import ground_sampling, paint
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.surface.continuation import continue_ground, footprint, guessed
from aug3d_core.surface.evidence import MIN_POINTS, Evidence, gather
from aug3d_core.surface.footprint import supported
from aug3d_core.surface.poisson import octree_depth, reconstruct, simplify
from aug3d_core.surface.shape import Shape, drop_degenerate, drop_small_components, split_to, triangle_areas

# Vertices that the shape itself may use; the others carry colour
SHAPE_SHARE = 0.5
# A hexagonal net of vertices with this spacing covers sqrt(3)/2 spacing^2 per vertex
AREA_PER_VERTEX = 0.866


@dataclass(frozen=True)
class Built:
    """A mesh, and how it came about."""

    mesh: Mesh
    points: int  # that the surface was drawn through
    octree_depth: int
    point_spacing: float  # world units
    vertex_spacing: float  # world units
    ground_sampling: float  # of the photos on the surface, world units per px
    guessed_share: float  # of the area: ground that goes on between and beyond the points


def build(
    points: Points,
    tracks: Tracks,
    views: Views,
    allowed: Bool[np.ndarray, " n"],
    images: Path,
    config: SurfaceConfig,
    tick: Callable[[], None],
) -> Built:
    """Build and colour the mesh that the allowed views support; raises InputError if there is none."""
    evidence = gather(points, tracks, views, allowed, config)
    if evidence is None:
        raise _nothing(f"fewer than {MIN_POINTS} good points are seen by two of {allowed.sum()} photos")
    givers = views.take(np.flatnonzero(allowed))
    whole_ground = continue_ground(evidence, givers, config.ground_reach * footprint(evidence, givers))
    shape = trim(reconstruct(whole_ground), whole_ground, config, rim=True)
    if not len(shape.triangles):
        raise _nothing(f"no surface stands through the {len(evidence.xyz)} points")
    # A triangle mesh has about two triangles per vertex
    shape = drop_degenerate(simplify(shape, int(2 * SHAPE_SHARE * config.vertex_budget)))
    chosen = np.flatnonzero(allowed)
    sampling = ground_sampling(shape, views, chosen)
    affordable = float(np.sqrt(triangle_areas(shape).sum() / config.vertex_budget / AREA_PER_VERTEX))
    spacing = max(sampling, affordable)
    shape = trim(split_to(shape, spacing, config.vertex_budget), whole_ground, config, rim=False)
    colours = paint(shape, spacing, views, chosen, images, config.views_per_vertex, tick)
    whole = colours.known[shape.triangles].all(axis=1)
    if not whole.any():
        raise _nothing("no photo sees any of the surface")
    used = np.unique(shape.triangles[whole])
    kept = shape.keep(whole)
    mesh = Mesh(kept.xyz.astype(np.float32), colours.rgb[used], kept.triangles)
    area = triangle_areas(kept)
    guess = float((area * guessed(kept.xyz[kept.triangles].mean(axis=1), evidence)).sum() / area.sum())
    return Built(mesh, len(evidence.xyz), octree_depth(whole_ground), evidence.spacing, spacing, sampling, guess)


def trim(shape: Shape, evidence: Evidence, config: SurfaceConfig, rim: bool) -> Shape:
    """Cut away what no point supports, then loose crumbs; `rim` keeps triangles that are supported in part."""
    max_gap = config.max_gap_spacings * evidence.spacing
    corners = supported(shape.xyz, evidence.xyz, evidence.spacing, max_gap)[shape.triangles]
    keep = corners.any(axis=1) if rim else corners.all(axis=1)
    return drop_small_components(shape.keep(keep), config.min_component_share)


def _nothing(problem: str) -> InputError:
    return InputError(
        problem, "take more photos of textured ground with at least 60 % overlap, or use larger working copies"
    )
