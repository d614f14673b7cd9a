"""What the factory knows of the training stage."""

from __future__ import annotations

from aug3d_core.heads.pixelnerf.config import TRAINING_PRESETS, TrainingConfig
from aug3d_core.run.metric import declared
from aug3d_core.run.stage import Stage

TRAINING = Stage(
    name="training",
    description="PixelNeRF training.",
    config=TrainingConfig,
    presets=TRAINING_PRESETS,
    inputs=("dataset",),
    entry="aug3d_core.training.stage:run",
    engines=("torch",),
    accuracy="train_psnr",
    metrics=declared(
        higher="rays_per_second train_psnr",
        lower="restarts loader_wait_share",
        neither="steps stopped_by encoder_from parameters",
    ),
    decidable=(
        "rendered_share",
        "encoder_channels",
        "hidden",
        "coarse_samples",
        "fine_samples",
        "depth_samples",
        "steps",
        "warmup_steps",
        "least_gain_db",
    ),
    resumable=True,
    alone=True,
)
