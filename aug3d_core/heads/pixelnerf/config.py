"""Configuration of the stages `training` and `evaluation`."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from aug3d_core.run.stage import StageConfig

AUTO, RANDOM = "auto", "random"


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
    encoder: Literal["small", "resnet34"] = Field(
        default="small", description="Convolutional encoder of the input views."
    )
    encoder_channels: int = Field(
        default=24, ge=4, le=512, description="Channels of the small encoder's first map, channels."
    )
    encoder_weights: str = Field(
        default=RANDOM,
        description="What resnet34 starts from: `random`, `auto` (ImageNet's if they are at hand), or a file of weights.",
    )
    encoder_frozen: bool = Field(default=False, description="Keep the encoder as it starts.")
    hidden: int = Field(default=64, ge=8, le=1024, description="Width of the field's layers, units.")
    blocks_per_view: int = Field(
        default=3, ge=1, le=8, description="Residual blocks before views are averaged, blocks."
    )
    blocks_pooled: int = Field(default=2, ge=1, le=8, description="Residual blocks after views are averaged, blocks.")
    frequencies: int = Field(default=6, ge=0, le=16, description="Octaves of the positional encoding, octaves.")
    normalised_z: bool = Field(
        default=False, description="Encode points turned into a view's frame, but not moved there."
    )
    see_pixels: bool = Field(
        default=True,
        description="Tell the field the input's colour where a point projects, and the angle between the two rays.",
    )
    even_exposure: bool = Field(
        default=True,
        description="Show the network every group at one brightness and contrast, whatever its photographs' exposure.",
    )
    mask_unseen: bool = Field(default=True, description="Leave out views that do not see a point.")
    blend_inputs: bool = Field(
        default=True, description="Colour = weighted blend of the input pixels + what the network adds."
    )
    encode_height: bool = Field(default=True, description="Tell the field how high in the slab a point lies.")
    density: Literal["relu", "softplus"] = Field(
        default="softplus",
        description="How density is kept positive: relu, as in the paper, or softplus, which starts thin and cannot die.",
    )
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
    max_gradient_norm: float = Field(
        default=1.0, ge=0, description="Norm at which a step's gradient is clipped (0: never), 1."
    )
    least_gain_db: float = Field(
        default=0.05,
        ge=0,
        description="Training ends early once half as many steps again gain less than this (0: never), dB.",
    )
    checkpoint_every: int = Field(default=200, ge=1, le=1_000_000, description="Steps between two checkpoints, steps.")
    seed: int = Field(default=0, ge=0, le=2**31 - 1, description="Seed of weights, batches and samples.")

    @property
    def files(self) -> tuple[Path, ...]:
        """The weights that the encoder starts from, where they are a file."""
        return () if self.encoder_weights in (AUTO, RANDOM) else (Path(self.encoder_weights).expanduser(),)


class EvaluationConfig(StageConfig):
    """How the trained model is judged."""

    input_views: int = Field(default=3, ge=1, le=16, description="Support views that every answer is given, views.")
    rays_per_batch: int = Field(default=1024, ge=1, le=1_000_000, description="Rays rendered at a time, rays.")
    resamples: int = Field(
        default=2000, ge=100, le=100_000, description="Bootstrap resamples of the test groups, resamples."
    )
    panels: int = Field(
        default=6, ge=0, le=1000, description="Test views drawn as panels, evenly from best to worst, views."
    )
    flythrough_frames: int = Field(
        default=16, ge=0, le=1000, description="Frames of a short flight rendered by the model (0: none), frames."
    )
    seed: int = Field(default=0, ge=0, le=2**31 - 1, description="Seed of the bootstrap.")


class PredictionConfig(StageConfig):
    """A view to predict, and what to predict it from. What is left open is chosen from the scene."""

    inputs: tuple[int, ...] = Field(
        default=(), description="Photo ids to predict from; none: those that show most alike with the view."
    )
    input_views: int = Field(default=3, ge=1, le=16, description="How many are chosen where none are given, views.")
    like: int | None = Field(default=None, ge=0, description="Photo whose camera the view has; it is no input.")
    at: tuple[float, float, float] | None = Field(default=None, description="Where the camera stands, world units.")
    look_at: tuple[float, float, float] | None = Field(
        default=None, description="The point in the image's middle, world units."
    )
    rays_per_batch: int = Field(default=1024, ge=1, le=1_000_000, description="Rays rendered at a time, rays.")


TRAINING_PRESETS: dict[str, TrainingConfig] = {
    "tiny": TrainingConfig(),
    "small": TrainingConfig(encoder_channels=32, coarse_samples=16, fine_samples=8, depth_samples=4, steps=12_000),
    "paper": TrainingConfig(
        groups_per_step=4,
        rays_per_group=128,
        encoder="resnet34",
        encoder_weights=AUTO,
        encoder_frozen=True,
        hidden=256,
        normalised_z=True,
        see_pixels=False,
        even_exposure=False,
        mask_unseen=False,
        blend_inputs=False,
        encode_height=False,
        density="relu",
        slab_bounds=False,
        opaque_end=False,
        coarse_samples=64,
        fine_samples=16,
        depth_samples=16,
        steps=400_000,
        learning_rate=1e-4,
        final_rate_share=1.0,
        warmup_steps=0,
        max_gradient_norm=0,
        least_gain_db=0,
        checkpoint_every=2000,
    ),
}
EVALUATION_PRESETS: dict[str, EvaluationConfig] = {
    "tiny": EvaluationConfig(),
    "small": EvaluationConfig(panels=12, flythrough_frames=32),
    "paper": EvaluationConfig(rays_per_batch=128, panels=24, flythrough_frames=64),
}
