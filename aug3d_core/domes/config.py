"""Settings of the sampling stage."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator

from aug3d_core.run.stage import StageConfig

SAM_FILES = ("config.json", "model.safetensors")


class SamplingConfig(StageConfig):
    """How many virtual cameras there are and where they may stand."""

    method: Literal["spiral", "dome", "grid", "buildings", "sam"] = Field(
        default="grid", description="How the places of domes are chosen."
    )
    choice: Literal["coverage", "uniform"] = Field(
        default="coverage",
        description="coverage: keep domes that show most surface from new directions, while they add enough; uniform: all.",
    )
    min_gain: float = Field(
        default=0.25,
        ge=0,
        le=1,
        description="What a dome must add to be kept, of what a dome shows on average [share].",
    )
    width_px: int = Field(default=256, ge=8, le=4096, description="Width of a virtual view; best the data set's [px].")
    height_px: int = Field(
        default=192, ge=8, le=4096, description="Height of a virtual view; best the data set's [px]."
    )
    domes: int = Field(
        default=16,
        ge=0,
        le=100_000,
        description="Most domes, 0 for none; coverage may find that fewer do [domes].",
    )
    views_per_dome: int | None = Field(
        default=None,
        ge=2,
        le=1000,
        description="Views on each dome; none: as many as a training group has members (K) [views].",
    )
    min_elevation_deg: float = Field(
        default=50.0,
        ge=5,
        le=90,
        description="Lowest camera above the horizon, seen from the dome's centre [degrees].",
    )
    max_elevation_deg: float = Field(
        default=88.0,
        ge=5,
        le=90,
        description="Highest camera above the horizon, seen from the dome's centre [degrees].",
    )
    azimuth_range_deg: float = Field(
        default=120.0, gt=0, le=360, description="Width of the sector of each dome that cameras stand in [degrees]."
    )
    radius_spread: float = Field(
        default=0.25,
        ge=0,
        le=2,
        description="How far cameras stand back: by up to this share more than where the cell fills the view [share].",
    )
    min_sampling_ratio: float = Field(
        default=0.7,
        gt=0,
        le=10,
        description="Finest ground sampling of a view, relative to the photos' at this view size [factor].",
    )
    min_cell_covered: float = Field(
        default=0.9, gt=0, le=1, description="How much of the ground that a dome looks at must have surface [share]."
    )
    min_view_covered: float = Field(
        default=0.9, ge=0, le=1, description="How much of a view must show surface [share]."
    )
    max_back_faces: float = Field(
        default=0.02, ge=0, le=1, description="How much of a view may show the surface from behind [share]."
    )
    max_smeared: float = Field(
        default=0.25,
        ge=0,
        le=1,
        description="How much of a view may be smeared: shown over twice as finely as photos of it justify [share].",
    )
    min_clearance: float = Field(
        default=0.4,
        ge=0,
        lt=1,
        description="Distance that a camera keeps from any surface, relative to its radius [share].",
    )
    slice_percentile: float | None = Field(
        default=None,
        gt=0,
        lt=100,
        description="Percentile of the heights above the ground at which a plane cuts buildings off; none: between "
        "what is low and what is high [%].",
    )
    sam_weights: str | None = Field(
        default=None,
        description="For method sam: folder with config.json and model.safetensors of a Segment Anything model, or its name "
        "on the Hugging Face hub, such as facebook/sam-vit-base.",
    )
    merged_boxes: int = Field(
        default=3,
        ge=0,
        le=100,
        description="Most neighbours (M) that each building is put together with under one dome [buildings].",
    )
    tries: int = Field(
        default=20, ge=1, le=1000, description="Cameras drawn for each one wanted, before a dome is given up [cameras]."
    )
    seed: int = Field(default=0, ge=0, le=2**31 - 1, description="Seed of the random placement.")

    @model_validator(mode="after")
    def _elevations_are_in_order(self) -> Self:
        lowest, highest = self.min_elevation_deg, self.max_elevation_deg
        if lowest > highest:
            raise ValueError(f"min_elevation_deg {lowest:g} is above max_elevation_deg {highest:g}")
        return self

    @property
    def engines(self) -> tuple[str, ...]:
        """What segments photographs, where that is asked for."""
        return ("torch", "transformers") if self.method == "sam" else ()

    @property
    def files(self) -> tuple[Path, ...]:
        """The model that segments photographs, where it is a folder or a file of one."""
        if self.method != "sam" or not self.sam_weights:
            return ()
        named = Path(self.sam_weights).expanduser()
        folder = named.parent if named.is_file() else named
        return tuple(folder / name for name in SAM_FILES) if folder.is_dir() else ()


PRESETS: dict[str, SamplingConfig] = {
    "tiny": SamplingConfig(),
    "small": SamplingConfig(width_px=512, height_px=384, domes=64),
    "paper": SamplingConfig(width_px=400, height_px=300, domes=200),
}
