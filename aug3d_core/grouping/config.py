"""Configuration of the similarity and grouping stages."""

from __future__ import annotations

from pydantic import Field

from aug3d_core.stage import StageConfig


class SimilarityConfig(StageConfig):
    """When two views count as connected."""

    connected_points: int = Field(
        default=20, ge=1, le=10_000, description="Shared points from which two views are connected."
    )


class GroupingConfig(StageConfig):
    """How many views make a group, how many groups there are, and what is kept for the test."""

    k: int = Field(default=10, ge=2, le=100, description="Views in a group (K), its centre among them.")
    groups: int = Field(
        default=64, ge=1, le=100_000, description="Most training groups; never more than training views."
    )
    test_share: float = Field(
        default=0.27, ge=0.05, le=0.5, description="Share of the views that look at the test block."
    )
    gap_shared_share: float = Field(
        default=0.10,
        ge=0.0,
        le=1.0,
        description="Share of its points that a training view may share with the test block.",
    )
    seed: int = Field(default=0, ge=0, description="Seed of every random choice.")


SIMILARITY_PRESETS: dict[str, SimilarityConfig] = {
    "tiny": SimilarityConfig(),
    "small": SimilarityConfig(),
    "paper": SimilarityConfig(),
}
GROUPING_PRESETS: dict[str, GroupingConfig] = {
    "tiny": GroupingConfig(k=8),
    "small": GroupingConfig(k=10, groups=256),
    "paper": GroupingConfig(k=20, groups=1024),
}
