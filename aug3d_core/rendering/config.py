"""Settings of the rendering stage."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from aug3d_core.stage import StageConfig


class RenderingConfig(StageConfig):
    """How the virtual views are rendered; their size and poses come from the sampling stage."""

    light: Literal["emission", "sunlit"] = Field(
        default="emission",
        description="emission: the texture as photographed; sunlit: lit once more by a sun and a sky, which adds shadows.",
    )
    sun_azimuth_deg: float = Field(
        default=150.0, ge=0, lt=360, description="Direction to the sun of sunlit, degrees clockwise from north (+y)."
    )
    sun_elevation_deg: float = Field(
        default=45.0, gt=0, le=90, description="Height of the sun of sunlit over the horizon, degrees."
    )
    samples: Literal["auto"] | Annotated[int, Field(ge=1, le=4096)] = Field(
        default="auto",
        description="Samples per pixel (count), or auto: the fewest that bring a few probe views to 38 dB of many samples.",
    )
    views_per_shard: int = Field(
        default=50, ge=1, le=100_000, description="Most views in one file (count): what a kill can lose per worker."
    )
    min_covered_share: float = Field(
        default=0.4, ge=0.0, le=1.0, description="Least share of a view (0 to 1) that must show surface to be kept."
    )


PRESETS: dict[str, RenderingConfig] = {
    "tiny": RenderingConfig(views_per_shard=32),
    "small": RenderingConfig(),
    "paper": RenderingConfig(),
}
