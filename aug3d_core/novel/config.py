"""Settings of the stage `prediction`."""

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
