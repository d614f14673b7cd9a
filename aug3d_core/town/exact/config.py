"""Settings of a town that is packed straight from its truth."""

from __future__ import annotations

from pydantic import Field

from aug3d_core.run.stage import StageConfig
from aug3d_core.town.config import TownConfig


class ExactTownConfig(StageConfig):
    """A town, its flight, and what differs from photograph to photograph of a camera that exposes by itself."""

    town: TownConfig = Field(
        default=TownConfig(width_px=256, samples=6, max_photos=32),
        description="The town and the flight; its photographs have the size of the packed views.",
    )
    k: int = Field(default=8, ge=2, le=64, description="Views in a group [views].")
    exposure_spread: float = Field(
        default=0.06,
        ge=0,
        le=1,
        description="Standard deviation of the logarithm of each photograph's exposure [1].",
    )
    white_spread: float = Field(
        default=0.01,
        ge=0,
        le=1,
        description="The same of red against green, and of blue against green: the white balance [1].",
    )
    outlier_share: float = Field(
        default=0.005, ge=0, lt=0.2, description="Share of points cut at either end before the slab is measured [1]."
    )
    margin_share: float = Field(
        default=0.1, ge=0, le=2, description="Widening of the slab at either side, share of its thickness."
    )
    shard_views: int = Field(default=64, ge=1, le=4096, description="Views in one shard file of the store [views].")
