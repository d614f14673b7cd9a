"""What a process that measures the network is told, and what it answers. Free of torch."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from aug3d_core.nerf.config import TrainingConfig
from aug3d_core.stage import Frozen

FAST, PLAIN = "fast", "plain"


class SpeedJob(Frozen):
    """Time a training step and a rendering of the fast and the plain network, or the memory that one of them takes."""

    scene: Path
    config: TrainingConfig
    side_px: int = Field(description="Views are cropped to squares of this side.")
    repeats: int
    memory_of: str | None = Field(default=None, description="Only run one of the two, and tell its peak.")


class SpeedTold(Frozen):
    """Processor seconds of each repeat, by network; and how far the two are apart."""

    train_seconds: dict[str, list[float]]
    render_seconds: dict[str, list[float]]
    train_rays: int
    render_rays: int
    output_difference: float = Field(description="Largest of colours in [0, 1].")
    gradient_difference: float = Field(description="Largest within a parameter, over that parameter's largest.")
    peak_mib: float


class RaceJob(Frozen):
    """Train the plain network for a while, and see when the fast one, as a preset has it, is as good."""

    scene: Path
    plain: TrainingConfig
    fast: TrainingConfig
    seconds: float


class RaceTold(Frozen):
    """Test PSNR of the plain network at the end, and what it took; of the fast one when first as good, and what that took."""

    plain_psnr: float
    plain_seconds: float
    plain_steps: int
    fast_psnr: float
    fast_seconds: float | None = Field(description="None: it never got there.")
    fast_steps: int
