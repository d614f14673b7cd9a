"""Settings of the stage `training`: what a step sees, the optimiser, and the head with settings of its own."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from aug3d_core.dataset.batches import Wanted
from aug3d_core.heads.config import DEFAULT, AnyHead, config_of, presets_of, usual_of
from aug3d_core.run.stage import StageConfig


class TrainingConfig(StageConfig):
    """How a head is trained."""

    head: AnyHead = Field(
        default_factory=lambda: config_of(DEFAULT).model_validate({"name": DEFAULT}),
        description="The model, by its name, and its settings.",
    )
    # What a step sees
    input_views: int = Field(
        default=3, ge=1, le=16, description="Views of each group that the model is given, at most [views]."
    )
    rendered_share: float = Field(
        default=0.5,
        ge=0,
        le=1,
        description="Share of the training groups drawn from rendered domes; the rest are real [share].",
    )
    groups_per_step: int = Field(default=2, ge=1, le=64, description="Groups in one training step [groups].")
    # How it is trained
    steps: int = Field(
        default=1200, ge=0, le=10_000_000, description="Training steps; 0: the first weights as they are [steps]."
    )
    learning_rate: float = Field(default=3e-3, gt=0, le=0.1, description="Adam's peak learning rate [1].")
    final_rate_share: float = Field(default=0.05, gt=0, le=1, description="Last learning rate, of the peak [share].")
    warmup_steps: int = Field(default=100, ge=0, le=100_000, description="Steps of linear warm-up [steps].")
    max_gradient_norm: float = Field(
        default=1.0, ge=0, description="Norm at which a step's gradient is clipped; 0: never [1]."
    )
    least_gain_db: float = Field(
        default=0.05,
        ge=0,
        description="Training stops early once it gains less than this over half as many more steps; 0: never [dB].",
    )
    checkpoint_every: int = Field(default=200, ge=1, le=1_000_000, description="Steps between checkpoints [steps].")
    seed: int = Field(default=0, ge=0, le=2**31 - 1, description="Seed of weights, batches and samples.")

    def started(self, start: str) -> TrainingConfig:
        """Return how the head is trained from other first weights; one that has none to choose, as it is."""
        if "start" not in type(self.head).model_fields:
            return self
        return self.model_copy(update={"head": self.head.model_copy(update={"start": start})})

    def from_random(self) -> TrainingConfig:
        """Return how a head that is meant to start from trained weights is trained from random ones: faster, and longer."""
        if "start" not in type(self.head).model_fields:
            return self
        longer = {"steps": 12 * self.steps, "warmup_steps": 12 * self.warmup_steps}
        more = longer | {"learning_rate": 2 * self.learning_rate}
        return self.started("random").model_copy(update=more)

    @property
    def wanted(self) -> Wanted:
        """What a step sees."""
        return Wanted(self.groups_per_step, self.input_views, self.rendered_share, self.head.pixels_per_group)

    @property
    def engines(self) -> tuple[str, ...]:
        """What the head computes with besides torch."""
        return self.head.engines

    @property
    def modules(self) -> tuple[str, ...]:
        """The code of the head alone: another head may change without training this one again."""
        return self.head.modules

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that the head's settings name."""
        return self.head.files


def presets(head: str | None = None) -> dict[str, TrainingConfig]:
    """Return the settings of training with a head, by the name of the preset; by default the usual head of each."""
    return {name: TrainingConfig(**presets_of(head or usual_of(name))[name]) for name in presets_of(DEFAULT)}
