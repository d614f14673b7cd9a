"""Configuration of the sfm stage."""

from __future__ import annotations

from pydantic import Field

from aug3d_core.stage import StageConfig


class SfmConfig(StageConfig):
    """How many features, and which pairs of photographs are compared."""

    max_features: int = Field(default=4096, ge=256, le=65536, description="Most keypoints per photograph (SIFT).")
    exhaustive_limit: int = Field(
        default=40,
        ge=2,
        le=100_000,
        description="With GPS, compare all pairs up to this many photographs, else neighbours.",
    )
    neighbours: int = Field(
        default=20, ge=2, le=1000, description="Nearest photographs by GPS that each one is compared with."
    )
    seed: int = Field(default=0, ge=0, description="Seed of every random choice.")


PRESETS: dict[str, SfmConfig] = {
    "tiny": SfmConfig(neighbours=16),
    "small": SfmConfig(max_features=8192, neighbours=24),
    "paper": SfmConfig(max_features=8192, neighbours=50),
}
