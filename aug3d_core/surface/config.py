"""Settings of the surface stage."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from aug3d_core.run.stage import StageConfig


class SurfaceConfig(StageConfig):
    """How the fused points become a coloured mesh. GSD: the size of a photo's pixel on the surface."""

    colour: Literal["vertex", "texture"] = Field(
        default="texture",
        description="Where colours live: a texture is sharp on few triangles; vertices are cheap, and coarser.",
    )
    max_error_gsd: float = Field(
        default=0.5,
        gt=0,
        le=20,
        description="Distance (GSD) that dropping triangles may move 95 % of the surface at most.",
    )
    texel_gsd: float = Field(default=1.0, gt=0, le=20, description="Size of a texel (GSD).")
    texel_budget: int = Field(
        default=8192**2, ge=64**2, le=8192**2, description="Texels at most; they grow where it would take more."
    )
    vertex_budget: int = Field(
        default=200_000,
        ge=1_000,
        le=20_000_000,
        description="Vertices that carry colour at most; fewer where the photos resolve no more.",
    )
    # Measured on the town against its truth, from 24 to 64: completeness within 0.5 % of extent grows from 0.952 to 0.971,
    # accuracy falls from 0.995 to 0.977, and what test photos see covered grows from 0.922 to 0.959; F-score is best near 48.
    max_gap_spacings: float = Field(
        default=56.0,
        ge=0,
        le=200,
        description="Widest hole between points to close, as a multiple of their spacing (a wall); wider ones stay.",
    )
    min_piece_points: int = Field(
        default=100, ge=0, le=10**9, description="Fused points (count) that a loose piece of surface must carry."
    )
    photos_per_place: int = Field(
        default=3, ge=1, le=10, description="Photos blended into the colour of a vertex or texel, best first."
    )
    check_views: int = Field(default=6, ge=1, le=100, description="Photos compared with the mesh for render_psnr.")
    check_px: int = Field(
        default=128, ge=16, le=4096, description="Longest side (px) at which mesh and photo are compared."
    )


PRESETS: dict[str, SurfaceConfig] = {
    "tiny": SurfaceConfig(),
    "small": SurfaceConfig(vertex_budget=1_000_000, check_px=256),
    "paper": SurfaceConfig(vertex_budget=5_000_000, check_px=400, check_views=20),
}
