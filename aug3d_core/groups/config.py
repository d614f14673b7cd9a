"""Configuration of the similarity and grouping stages."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from aug3d_core.run.stage import StageConfig

MOST_K = 10  # that `k=auto` comes to: the paper's better size
ENOUGH = 5  # that `auto` takes


class SimilarityConfig(StageConfig):
    """No settings."""


class GroupingConfig(StageConfig):
    """How many views make a group, how many groups there are, and what is kept for the test."""

    method: Literal["sequence", "grid", "grid_any_angle", "ray", "shared", "surface"] = Field(
        default="shared",
        description="What makes views belong together: capture order; place of the camera, with or without its direction; "
        "where the central ray meets the ground; shared points; seen surface.",
    )
    grid_angle_deg: float = Field(
        default=30.0, gt=0, le=180, description="Most angle between views of a group; for grid [degrees]."
    )
    k: Annotated[int, Field(ge=2, le=100)] | Literal["auto"] = Field(
        default=10,
        description=f"Views in a group (K), its centre among them; auto: as many as overlap, at most {MOST_K} [views].",
    )
    groups: int = Field(
        default=64, ge=1, le=100_000, description="Most training groups; never more than training views [groups]."
    )
    test_share: float = Field(
        default=0.27, ge=0.05, le=0.5, description="How many of the views look at the test block [share]."
    )
    folds: int | None = Field(
        default=None,
        ge=1,
        le=20,
        description="How often the scene is trained and tested, each time with another block of ground as the test. 1: an end "
        "of the ground; 2: each end; more: all the ground, cut into so many; none: 1, or 2 where one end tests too few "
        "photographs or training sees it [folds].",
    )
    fold: int = Field(
        default=0,
        ge=0,
        le=19,
        description="Block that is the test, counted from 0; a run of all stages takes each in turn, whatever is set.",
    )
    gap_footprints: float = Field(
        default=1.0,
        gt=0.0,
        le=10.0,
        description="Least distance between where training and the test block look; a footprint is as wide as the ground in "
        "a photo [footprints].",
    )
    gap_shared_share: float = Field(
        default=0.10,
        ge=0.0,
        le=1.0,
        description="How many of its points a training view may share with the test block [share].",
    )
    enough: int = Field(
        default=0,
        ge=0,
        le=1000,
        description="A photograph outside the test is left out if nine tenths of the surface in it are seen by this many "
        "others; 0: none is left out [photographs].",
    )
    seed: int = Field(default=0, ge=0, le=2**31 - 1, description="Seed of every random choice.")

    @model_validator(mode="after")
    def _there_is_the_fold(self) -> Self:
        if self.folds is not None and self.fold >= self.folds:
            raise ValueError(f"there is no fold {self.fold}: folds is {self.folds}, and they are counted from 0")
        return self


GROUPING_PRESETS: dict[str, GroupingConfig] = {
    "tiny": GroupingConfig(k=8),
    "small": GroupingConfig(k=10, groups=256),
    "paper": GroupingConfig(k=20, groups=1024),
}
SIMILARITY_PRESETS: dict[str, SimilarityConfig] = {name: SimilarityConfig() for name in GROUPING_PRESETS}
