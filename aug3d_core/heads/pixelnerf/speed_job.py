"""The job and the result of the process that measures the network. Imports no torch."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from aug3d_core.heads.pixelnerf.config import PixelNerfConfig
from aug3d_core.run.stage import Frozen

FAST, PLAIN = "fast", "plain"


class SpeedJob(Frozen):
    """Time a training step and a rendering of the fast and the plain network, or measure the memory of one of them."""

    scene: Path
    config: PixelNerfConfig
    input_views: int = Field(default=3, description="Views that the one group is given.")
    seed: int = 0
    side_px: int = Field(description="Views are cropped to squares of this side.")
    repeats: int
    memory_of: str | None = Field(
        default=None, description="Run only this one of the two networks, and report its peak memory."
    )


class SpeedTold(Frozen):
    """Processor time of each repeat [s], by network, and the largest differences between the two."""

    train_seconds: dict[str, list[float]]
    render_seconds: dict[str, list[float]]
    train_rays: int
    render_rays: int
    output_difference: float = Field(description="Largest difference of a colour in [0, 1].")
    gradient_difference: float = Field(
        description="Largest difference within a parameter's gradient, divided by that gradient's largest value."
    )
    peak_mib: float
