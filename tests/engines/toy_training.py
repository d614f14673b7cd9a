"""A network small enough to be trained on the toy scene in a second."""

from typing import Any

from aug3d_core.heads.pixelnerf.config import PixelNerfConfig
from aug3d_core.training.config import TrainingConfig

HEAD = PixelNerfConfig(
    hidden=16, encoder_channels=4, coarse_samples=6, fine_samples=4, depth_samples=2, rays_per_group=48,
)  # fmt: skip
CONFIG = TrainingConfig(head=HEAD, steps=12, warmup_steps=4, checkpoint_every=5, learning_rate=3e-3)


def changed(config: TrainingConfig = CONFIG, **changes: Any) -> TrainingConfig:
    """Return settings of training with changes to them or to those of their head."""
    own = {name: changes.pop(name) for name in [*changes] if name in TrainingConfig.model_fields}
    return config.model_copy(update={"head": config.head.model_copy(update=changes)} | own)


def silent(done: int, total: int, what: str) -> None:
    """Take no notice."""
