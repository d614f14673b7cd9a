"""Configuration of the overlap stage."""

from __future__ import annotations

from pydantic import Field

from aug3d_core.run.stage import StageConfig


class OverlapConfig(StageConfig):
    """How every way of grouping is tried."""

    groups: int = Field(
        default=64,
        ge=1,
        le=1000,
        description="Groups that each way of grouping makes for the comparison, at most [groups].",
    )
    seed: int = Field(default=0, ge=0, le=2**31 - 1, description="Seed of every random choice.")


PRESETS: dict[str, OverlapConfig] = {
    "tiny": OverlapConfig(),
    "small": OverlapConfig(),
    "paper": OverlapConfig(groups=256),
}
