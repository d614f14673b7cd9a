"""What the factory knows of the training stage."""

from __future__ import annotations

from aug3d_core.heads.config import config_of, names
from aug3d_core.run.metric import declared
from aug3d_core.run.stage import Stage
from aug3d_core.training.config import TrainingConfig, presets

TRAINING = Stage(
    name="training",
    description="Training of the model.",
    config=TrainingConfig,
    presets=presets(),
    inputs=("dataset",),
    entry="aug3d_core.training.stage:run",
    engines=("pillow", "torch"),
    accuracy="train_psnr",
    metrics=declared(
        higher="groups_per_second train_psnr",
        lower="restarts loader_wait_share",
        neither="head scenes steps stopped_by encoder_from started_with parameters",
    ),
    decidable=(
        "rendered_share",
        *dict.fromkeys(f"head.{field}" for name in names() for field in config_of(name).decidable),
        "steps",
        "warmup_steps",
        "least_gain_db",
    ),
    resumable=True,
    shards=("checkpoint/*.pt",),
    alone=True,
)
