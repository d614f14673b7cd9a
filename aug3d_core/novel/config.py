"""Settings of the stages `prediction` and `preview`."""

from __future__ import annotations

from pydantic import Field

from aug3d_core.run.stage import StageConfig


class PredictionConfig(StageConfig):
    """A view to predict, and what to predict it from. What is left open is chosen from the scene."""

    inputs: tuple[int, ...] = Field(
        default=(), description="Photo ids to predict from; none: those that show most alike with the view."
    )
    input_views: int = Field(default=3, ge=1, le=16, description="How many are chosen where none are given [views].")
    like: int | None = Field(default=None, ge=0, description="Photo whose camera the view has; it is no input.")
    at: tuple[float, float, float] | None = Field(default=None, description="Where the camera stands [world units].")
    look_at: tuple[float, float, float] | None = Field(
        default=None, description="The point in the image's middle [world units]."
    )


class PreviewConfig(StageConfig):
    """How photographs are looked at before anything but their poses is known."""

    width_px: int = Field(default=256, ge=8, le=4096, multiple_of=4, description="Width of every view [px].")
    height_px: int = Field(default=192, ge=8, le=4096, multiple_of=4, description="Height of every view [px].")
    input_views: int = Field(default=4, ge=1, le=16, description="Photographs that a view is predicted from [views].")
    views: int = Field(
        default=8,
        ge=1,
        le=1000,
        description="Photographs that are predicted from the others, evenly along the flight [views].",
    )
    frames: int = Field(default=48, ge=0, le=10_000, description="Frames of the flight; 0: none [frames].")
