"""Settings of the rendering stage."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from aug3d_core.run.stage import StageConfig


class RenderingConfig(StageConfig):
    """How the virtual views are rendered; their size and poses come from the sampling stage."""

    light: Literal["emission", "sunlit"] = Field(
        default="emission",
        description="emission: the texture as photographed; sunlit: additionally lit by a sun and a sky, with shadows.",
    )
    sun_azimuth_deg: float = Field(
        default=150.0,
        ge=0,
        lt=360,
        description="Direction to the sun, for sunlit; clockwise from north (+y) [degrees].",
    )
    sun_elevation_deg: float = Field(
        default=45.0, gt=0, le=90, description="Height of the sun above the horizon, for sunlit [degrees]."
    )
    samples: Literal["auto"] | Annotated[int, Field(ge=1, le=4096)] = Field(
        default="auto",
        description="Samples per pixel, or auto: the fewest with which probe views reach 38 dB against many [samples].",
    )
    views_per_shard: int = Field(
        default=50,
        ge=1,
        le=100_000,
        description="Largest number of views per file: a killed worker loses at most these [views].",
    )
    min_covered_share: float = Field(
        default=0.4,
        ge=0.0,
        le=1.0,
        description="How much of a view must show surface; other views are dropped [share].",
    )


PRESETS: dict[str, RenderingConfig] = {
    "tiny": RenderingConfig(views_per_shard=32),
    "small": RenderingConfig(),
    "paper": RenderingConfig(),
}
