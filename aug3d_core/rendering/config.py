"""Settings of the rendering stage."""

from __future__ import annotations

from pydantic import Field

from aug3d_core.stage import StageConfig


class RenderingConfig(StageConfig):
    """How the virtual views are rendered; their size and poses come from the sampling stage."""

    samples: int = Field(
        default=16, ge=1, le=4096, description="Samples per pixel (count); they only smooth edges, so few are enough."
    )
    views_per_shard: int = Field(
        default=200, ge=1, le=100_000, description="Views per worker process (count): what a kill can lose at most."
    )
    min_covered_share: float = Field(
        default=0.4, ge=0.0, le=1.0, description="Least share of a view (0 to 1) that must show surface to be kept."
    )


PRESETS: dict[str, RenderingConfig] = {
    "tiny": RenderingConfig(views_per_shard=100),
    "small": RenderingConfig(),
    "paper": RenderingConfig(samples=32),
}
