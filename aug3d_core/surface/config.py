"""Settings of the surface stage."""

from __future__ import annotations

from pydantic import Field

from aug3d_core.stage import StageConfig


class SurfaceConfig(StageConfig):
    """How the points become a mesh."""

    vertex_budget: int = Field(
        default=200_000,
        ge=1_000,
        le=20_000_000,
        description="Vertices at most; fewer where the photos resolve no more.",
    )
    max_error_px: float = Field(
        default=2.0, gt=0, le=20, description="Reprojection error (px) above which a point is not used."
    )
    min_angle_deg: float = Field(
        default=2.0,
        ge=0,
        le=45,
        description="Angle (degrees) between a point's outermost rays below which its depth is a guess.",
    )
    neighbours: int = Field(default=12, ge=4, le=100, description="Points that a normal and an outlier test look at.")
    outlier_sigma: float = Field(
        default=2.5,
        gt=0,
        le=10,
        description="Standard deviations of neighbour distance beyond which a point is an outlier.",
    )
    max_gap_spacings: float = Field(
        default=12.0, ge=1, le=200, description="Widest hole to close, as a multiple of the points' spacing."
    )
    ground_reach: float = Field(
        default=1.0,
        ge=0,
        le=10,
        description="How far the ground goes on beyond the points, where a photo looks, in sides of its footprint.",
    )
    min_component_share: float = Field(
        default=0.01, ge=0, le=1, description="Share of all triangles below which a loose piece is dropped."
    )
    views_per_vertex: int = Field(
        default=3, ge=1, le=10, description="Photos blended into a vertex colour, best first."
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
