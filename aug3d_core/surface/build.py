"""One mesh from the points and the photographs of the allowed roles alone."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.geometry.fused import Fused
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.geometry.views import Tracks, Views
from aug3d_core.run.errors import InputError
from aug3d_core.surface.atlas import atlas_within
from aug3d_core.surface.colour import Photographs, ground_sampling, paint_vertices
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.surface.decimate import decimate
from aug3d_core.surface.evidence import gather
from aug3d_core.surface.poisson import octree_depth, reconstruct
from aug3d_core.surface.shape import Shape, split_to, triangle_areas
from aug3d_core.surface.texture import paint_texture
from aug3d_core.surface.trim import bridged_share, trim

# A hexagonal net of vertices with this spacing covers sqrt(3)/2 spacing^2 per vertex
AREA_PER_VERTEX = 0.866
# Texels of a texture per texel that lies in a triangle: charts are not square
TEXELS_PER_TEXEL = 1.6


@dataclass
class Clock:
    """Seconds by step."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Count the time of a block under a name."""
        start = time.monotonic()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.monotonic() - start


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

    @property
    def best(self) -> Mesh | TexturedMesh:
        """The mesh in its best colours."""
        return self.textured or self.mesh


def build(
    fused: Fused,
    tracks: Tracks,
    views: Views,
    chosen: Int[np.ndarray, " m"],
    images: Path,
    masks: Path,
    config: SurfaceConfig,
    clock: Clock,
    tick: Callable[[], None],
) -> Built:
    """Build and colour the mesh that the points and the chosen views support; raises InputError if there is none."""
    with clock.step("evidence"):
        evidence = gather(fused)
    with clock.step("poisson"):
        raw = reconstruct(evidence)
    with clock.step("trimming"):
        fine = trim(raw, evidence, config.max_gap_spacings * evidence.spacing, config.min_piece_points)
    if not len(fine.triangles):
        raise _nothing(f"no surface stands through the {len(evidence.xyz)} fused points")
    sampling = ground_sampling(fine, views, chosen)
    if np.isnan(sampling):
        raise _nothing("no photograph frames any of the surface through the fused points")
    with clock.step("decimation"):
        coarse = decimate(fine, config.max_error_gsd * sampling)
    if config.colour == "texture":
        detail = _texel(coarse.shape, sampling, config)
        shape = coarse.shape
    else:
        affordable = float(np.sqrt(triangle_areas(coarse.shape).sum() / config.vertex_budget / AREA_PER_VERTEX))
        detail = max(sampling, affordable)
        shape = split_to(coarse.shape, detail, config.vertex_budget)
    photographs = Photographs(views, chosen, images, masks, shape, detail)
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
            textured = paint_texture(photographs, shape, rgb, atlas, config.photos_per_place, tick)
    return Built(
        Mesh(shape.xyz.astype(np.float32), rgb, shape.triangles),
        textured,
        len(evidence.xyz),
        evidence.spacing,
        octree_depth(evidence),
        len(fine.triangles),
        coarse.error,
        sampling,
        detail,
        photographs.gains,
        charts,
        bridged_share(fine, evidence),
    )


def _texel(shape: Shape, sampling: float, config: SurfaceConfig) -> float:
    affordable = float(np.sqrt(TEXELS_PER_TEXEL * triangle_areas(shape).sum() / config.texel_budget))
    return max(config.texel_gsd * sampling, affordable)


def _coloured(
    photographs: Photographs, shape: Shape, config: SurfaceConfig, tick: Callable[[], None]
) -> tuple[Shape, np.ndarray]:
    """Colour the vertices and drop what no photo sees."""
    colours = paint_vertices(photographs, shape, config.photos_per_place, tick)
    whole = colours.known[shape.triangles].all(axis=1)
    if not whole.any():
        raise _nothing("no photo sees any of the surface")
    return shape.keep(whole), colours.rgb[np.unique(shape.triangles[whole])]


def _nothing(problem: str) -> InputError:
    return InputError(
        problem, "take more photos of textured ground with at least 60 % overlap, or use larger working copies"
    )
