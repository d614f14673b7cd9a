"""Settings of the stage `evaluation`."""

from __future__ import annotations

from pydantic import Field

from aug3d_core.run.stage import StageConfig


class EvaluationConfig(StageConfig):
    """How the trained model is judged."""

    input_views: int = Field(default=3, ge=1, le=16, description="Support views that every answer is given [views].")
    panels: int = Field(
        default=6, ge=0, le=1000, description="Test views drawn as panels, evenly from best to worst [views]."
    )
    flythrough_frames: int = Field(
        default=24, ge=0, le=1000, description="Frames of a short flight rendered by the model (0: none) [frames]."
    )


PRESETS: dict[str, EvaluationConfig] = {
    "tiny": EvaluationConfig(),
    "small": EvaluationConfig(panels=12, flythrough_frames=48),
    "paper": EvaluationConfig(panels=24, flythrough_frames=96),
}
