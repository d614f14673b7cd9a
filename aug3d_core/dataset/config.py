"""Configuration of the stage `dataset`."""

from __future__ import annotations

from pydantic import Field

from aug3d_core.run.stage import StageConfig


class DatasetConfig(StageConfig):
    """What the packed scene looks like."""

    width_px: int = Field(default=256, ge=8, le=4096, multiple_of=4, description="Width of every packed view [px].")
    height_px: int = Field(default=192, ge=8, le=4096, multiple_of=4, description="Height of every packed view [px].")
    outlier_share: float = Field(
        default=0.005,
        ge=0,
        lt=0.2,
        description="Share of sparse points cut at either end before the slab is measured [share].",
    )
    margin_share: float = Field(
        default=0.1, ge=0, le=2, description="Widening of the slab at either side, of its thickness [share]."
    )
    shard_views: int = Field(default=64, ge=1, le=4096, description="Views in one shard file of the store [views].")


PRESETS: dict[str, DatasetConfig] = {
    "tiny": DatasetConfig(),
    "small": DatasetConfig(width_px=512, height_px=384),
    "paper": DatasetConfig(width_px=400, height_px=300),
}
