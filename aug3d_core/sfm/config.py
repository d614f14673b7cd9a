"""Configuration of the matching and sfm stages."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from aug3d_core.run.stage import StageConfig


class MatchingConfig(StageConfig):
    """How many features, and which pairs of photographs are compared."""

    max_features: int = Field(
        default=4096, ge=256, le=65536, description="Most keypoints per photograph (SIFT) [keypoints]."
    )
    first_octave: int = Field(
        default=-1,
        ge=-1,
        le=2,
        description="Where SIFT begins: -1 at twice the photograph's size, 0 at its own, 1 at half.",
    )
    pairs: Literal["auto", "exhaustive", "gps", "coarse"] = Field(
        default="auto",
        description="Which photographs are compared. exhaustive: each with each; gps: with its neighbours by GPS; coarse: with "
        "those that look alike to a quick comparison; auto: exhaustive for few photographs, else gps where what "
        "photographs show agrees with it, else coarse.",
    )
    exhaustive_limit: int = Field(
        default=40,
        ge=2,
        le=100_000,
        description="Up to this many photographs, pairs: auto is exhaustive [photographs].",
    )
    neighbours: int = Field(
        default=20,
        ge=2,
        le=1000,
        description="Photographs that each one is compared with, for gps the nearest, for coarse the most alike [photographs].",
    )
    seed: int = Field(default=0, ge=0, le=2**31 - 1, description="Seed of every random choice.")


class SfmConfig(StageConfig):
    """How the matches become poses and points."""

    mapper: Literal["auto", "incremental", "global", "hierarchical"] = Field(
        default="auto",
        description="incremental: place photographs one by one; global: all at once; hierarchical: part by part; auto: "
        "incremental unless they are many.",
    )
    seed: int = Field(default=0, ge=0, le=2**31 - 1, description="Seed of every random choice.")


MATCHING_PRESETS: dict[str, MatchingConfig] = {
    "tiny": MatchingConfig(neighbours=16),
    "small": MatchingConfig(max_features=8192, neighbours=24),
    "paper": MatchingConfig(max_features=8192, neighbours=50),
}
PRESETS: dict[str, SfmConfig] = {name: SfmConfig() for name in MATCHING_PRESETS}
