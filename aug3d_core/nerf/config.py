"""Configuration of the stages `training` and `evaluation`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from aug3d_core.stage import StageConfig


class TrainingConfig(StageConfig):
    """The network and how it is trained. The presets differ from the paper's network field by field."""

    # What a step sees
    input_views: int = Field(default=3, ge=1, le=16, description="Views that the model is given of each group, views.")
    rendered_share: float = Field(
        default=0.5,
        ge=0,
        le=1,
        description="Share of the training groups drawn from rendered domes, the rest are real, 1.",
    )
    groups_per_step: int = Field(default=2, ge=1, le=64, description="Groups in one training step, groups.")
    rays_per_group: int = Field(
        default=256, ge=1, le=65536, description="Rays of each group in one training step, rays."
    )
    # The network
    encoder: Literal["small"] = Field(default="small", description="Convolutional encoder of the input views.")
    encoder_channels: int = Field(
        default=24, ge=4, le=512, description="Channels of the encoder's first map, channels."
    )
    hidden: int = Field(default=64, ge=8, le=1024, description="Width of the field's layers, units.")
    blocks_per_view: int = Field(
        default=3, ge=1, le=8, description="Residual blocks before views are averaged, blocks."
    )
    blocks_pooled: int = Field(default=2, ge=1, le=8, description="Residual blocks after views are averaged, blocks.")
    frequencies: int = Field(default=6, ge=0, le=16, description="Octaves of the positional encoding, octaves.")
    blend_inputs: bool = Field(
        default=True, description="Colour = weighted blend of the input pixels + what the network adds."
    )
    encode_height: bool = Field(default=True, description="Tell the field how high in the slab a point lies.")
    # Where along a ray
    slab_bounds: bool = Field(default=True, description="Cut each ray to the layer between ground and roofs.")
    opaque_end: bool = Field(
        default=True, description="Let the last sample of a ray stop all light: below it is the ground."
    )
    coarse_samples: int = Field(default=8, ge=2, le=512, description="Stratified samples per ray, samples.")
    fine_samples: int = Field(
        default=4, ge=0, le=512, description="Samples drawn where the coarse network saw matter, samples."
    )
    depth_samples: int = Field(default=2, ge=0, le=512, description="Samples drawn around the coarse depth, samples.")
    # How it is trained
    steps: int = Field(default=1200, ge=1, le=10_000_000, description="Training steps, steps.")
    learning_rate: float = Field(default=3e-3, gt=0, le=0.1, description="Adam's peak learning rate, 1.")
    final_rate_share: float = Field(
        default=0.05, gt=0, le=1, description="Last learning rate as a share of the peak, 1."
    )
    warmup_steps: int = Field(default=100, ge=0, le=100_000, description="Steps of linear warm-up, steps.")
    checkpoint_every: int = Field(default=200, ge=1, le=1_000_000, description="Steps between two checkpoints, steps.")
    seed: int = Field(default=0, ge=0, le=2**31 - 1, description="Seed of weights, batches and samples.")


class EvaluationConfig(StageConfig):
    """How the trained model is judged."""

    input_views: int = Field(default=3, ge=1, le=16, description="Support views that every answer is given, views.")
    rays_per_batch: int = Field(default=4096, ge=1, le=1_000_000, description="Rays rendered at a time, rays.")
    resamples: int = Field(
        default=2000, ge=100, le=100_000, description="Bootstrap resamples of the test groups, resamples."
    )
    panels: int = Field(
        default=6, ge=0, le=1000, description="Test views drawn as panels, evenly from best to worst, views."
    )
    seed: int = Field(default=0, ge=0, le=2**31 - 1, description="Seed of the bootstrap.")


TRAINING_PRESETS: dict[str, TrainingConfig] = {
    "tiny": TrainingConfig(),
    "small": TrainingConfig(encoder_channels=32, coarse_samples=16, fine_samples=8, depth_samples=4, steps=12_000),
    "paper": TrainingConfig(
        groups_per_step=4,
        rays_per_group=128,
        encoder_channels=64,
        hidden=256,
        blend_inputs=False,
        encode_height=False,
        slab_bounds=False,
        opaque_end=False,
        coarse_samples=64,
        fine_samples=16,
        depth_samples=16,
        steps=400_000,
        learning_rate=1e-4,
        final_rate_share=1.0,
        checkpoint_every=2000,
    ),
}
EVALUATION_PRESETS: dict[str, EvaluationConfig] = {
    "tiny": EvaluationConfig(),
    "small": EvaluationConfig(panels=12),
    "paper": EvaluationConfig(panels=24),
}
