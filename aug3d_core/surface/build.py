"""A surface and the photographs of the allowed roles alone -> one coloured mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.geometry.views import Tracks, Views
from aug3d_core.surface.atlas import atlas_within
from aug3d_core.surface.clock import Clock
from aug3d_core.surface.colour import Photographs, paint_vertices
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.surface.draw import Drawn, nothing
from aug3d_core.surface.kept import NOTHING_KEPT, Kept
from aug3d_core.surface.shape import Shape, split_to, triangle_areas
from aug3d_core.surface.texture import paint_texture

BLENDED = 3  # photos in the colour of a vertex or texel, best first: more blur it
# A hexagonal net of vertices with this spacing covers sqrt(3)/2 spacing^2 per vertex
AREA_PER_VERTEX = 0.866
# Texels of a texture per texel that lies in a triangle: charts are not square
TEXELS_PER_TEXEL = 1.6


@dataclass(frozen=True)
class Built:
    """A mesh, and how it came about. Lengths in world units."""

    mesh: Mesh
    textured: TexturedMesh | None
    points: int  # that the surface was drawn through
    point_spacing: float
    octree_depth: int
    triangles_full: int  # before decimation
    decimation_error: float
    ground_sampling: float  # of the photos on the surface, world units per px
    detail: float  # size of a texel, or distance of vertices
    gains: Float[np.ndarray, "m 3"]  # that even out the exposures of the photos used
    charts: int
    bridged_share: float  # of the area: closed gaps, where no point is
    tiles: int  # of ground that it was drawn in

    @property
    def best(self) -> Mesh | TexturedMesh:
        """The mesh in its best colours."""
        return self.textured or self.mesh


def build(
    drawn: Drawn,
    tracks: Tracks,
    views: Views,
    chosen: Int[np.ndarray, " m"],
    images: Path,
    masks: Path,
    config: SurfaceConfig,
    clock: Clock,
    tick: Callable[[], None],
    kept: Kept = NOTHING_KEPT,
) -> Built:
    """Colour a surface from the chosen views; raises InputError if none sees any of it."""
    sampling = drawn.ground_sampling
    if config.colour == "texture":
        detail = _texel(drawn.shape, sampling, config)
        shape = drawn.shape
    else:
        affordable = float(np.sqrt(triangle_areas(drawn.shape).sum() / config.vertex_budget / AREA_PER_VERTEX))
        detail = max(sampling, affordable)
        shape = split_to(drawn.shape, detail, config.vertex_budget)
    photographs = Photographs(views, chosen, images, masks, shape, detail, kept)
    with clock.step("exposure"):
        photographs.even_out(tracks)
    with clock.step("vertex colours"):
        shape, rgb = _coloured(photographs, shape, config, tick)
    textured, charts = None, 0
    if config.colour == "texture":
        with clock.step("atlas"):
            atlas, detail = atlas_within(shape, detail, config.texel_budget)
            charts = atlas.charts
        with clock.step("texture"):
            textured = paint_texture(photographs.for_detail(detail), shape, rgb, atlas, BLENDED, tick)
    return Built(
        Mesh(shape.xyz.astype(np.float32), rgb, shape.triangles),
        textured,
        drawn.points,
        drawn.spacing,
        drawn.octree_depth,
        drawn.triangles_full,
        drawn.decimation_error,
        sampling,
        detail,
        photographs.gains,
        charts,
        drawn.bridged_area / drawn.area,
        drawn.tiles,
    )


def _texel(shape: Shape, sampling: float, config: SurfaceConfig) -> float:
    affordable = float(np.sqrt(TEXELS_PER_TEXEL * triangle_areas(shape).sum() / config.texel_budget))
    return max(config.texel_gsd * sampling, affordable)


def _coloured(
    photographs: Photographs, shape: Shape, config: SurfaceConfig, tick: Callable[[], None]
) -> tuple[Shape, np.ndarray]:
    """Colour the vertices and drop what no photo sees."""
    colours = paint_vertices(photographs, shape, BLENDED, tick)
    whole = colours.known[shape.triangles].all(axis=1)
    if not whole.any():
        raise nothing("no photo sees any of the surface")
    return shape.keep(whole), colours.rgb[np.unique(shape.triangles[whole])]
