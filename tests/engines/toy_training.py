"""A network small enough to be trained on the toy scene in a second."""

from aug3d_core.heads.pixelnerf.config import TrainingConfig

CONFIG = TrainingConfig(
    steps=12, hidden=16, encoder_channels=4, coarse_samples=6, fine_samples=4, depth_samples=2, rays_per_group=48,
    warmup_steps=4, checkpoint_every=5, learning_rate=3e-3,
)  # fmt: skip


def silent(done: int, total: int, what: str) -> None:
    """Take no notice."""
