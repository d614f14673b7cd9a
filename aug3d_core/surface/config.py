"""Settings of the surface stage."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from aug3d_core.run.stage import StageConfig


class SurfaceConfig(StageConfig):
    """How the fused points become a coloured mesh. GSD: the size of a photo's pixel on the surface."""

    colour: Literal["vertex", "texture"] = Field(
        default="texture",
        description="texture: colours lie in a picture, as sharp as photos; vertex: one at each corner of a triangle, coarser.",
    )
    max_error_gsd: float = Field(
        default=0.5,
        gt=0,
        le=20,
        description="Distance that dropping triangles may move 95 % of the surface at most [GSD].",
    )
    texel_gsd: float = Field(default=1.0, gt=0, le=20, description="Size of a texel, a pixel of the texture [GSD].")
    texel_budget: int = Field(
        default=8192**2,
        ge=64**2,
        le=8192**2,
        description="Texels in the texture at most; where texel_gsd would take more, they are larger [texels].",
    )
    vertex_budget: int = Field(
        default=200_000,
        ge=1_000,
        le=20_000_000,
        description="Vertices that carry colour at most; fewer where the photos resolve no more [vertices].",
    )
    # Measured on the town against its truth, from 24 to 64: completeness within 0.5 % of extent grows from 0.952 to 0.971,
    # accuracy falls from 0.995 to 0.977, and what test photos see covered grows from 0.922 to 0.959; F-score is best near 48.
    max_gap_spacings: float = Field(
        default=56.0,
        ge=0,
        le=200,
        description="Widest hole between points that is closed, such as a wall; wider ones stay [spacings of the points].",
    )
    min_piece_points: int = Field(
        default=100, ge=0, le=10**9, description="Fused points that a loose piece of surface must carry [points]."
    )
    check_views: int = Field(
        default=6, ge=1, le=100, description="Photos compared with the mesh for the metric render_psnr [photographs]."
    )
    check_px: int = Field(
        default=128, ge=16, le=4096, description="Longest side at which mesh and photo are compared [px]."
    )


PRESETS: dict[str, SurfaceConfig] = {
    "tiny": SurfaceConfig(),
    "small": SurfaceConfig(vertex_budget=1_000_000, check_px=256),
    "paper": SurfaceConfig(vertex_budget=5_000_000, check_px=400, check_views=20),
}
