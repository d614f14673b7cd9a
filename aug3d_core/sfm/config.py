"""Configuration of the matching and sfm stages."""

from __future__ import annotations

from pydantic import Field

from aug3d_core.stage import StageConfig


class MatchingConfig(StageConfig):
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


class SfmConfig(StageConfig):
    """How the matches become poses and points."""

    seed: int = Field(default=0, ge=0, description="Seed of every random choice.")


MATCHING_PRESETS: dict[str, MatchingConfig] = {
    "tiny": MatchingConfig(neighbours=16),
    "small": MatchingConfig(max_features=8192, neighbours=24),
    "paper": MatchingConfig(max_features=8192, neighbours=50),
}
PRESETS: dict[str, SfmConfig] = {name: SfmConfig() for name in MATCHING_PRESETS}
