"""Configuration of the two stages that the study of stability adds to the factory's."""

from __future__ import annotations

from pydantic import Field

from aug3d_core.stage import StageConfig


class SpoilConfig(StageConfig):
    """How what a stage made is damaged, before the next stage reads it."""

    damage: str = Field(description='"module:function" of the damage.')
    dose: float = Field(description="How much of it; the unit is the perturbation's.")
    seed: int = Field(default=0, ge=0, description="Seed of every random choice.")


class ComputedConfig(StageConfig):
    """A cell that needs no stage of the factory: a function of dose, method and seed on a world that is known exactly."""

    compute: str = Field(description='"module:function" of what is computed.')
    dose: float = Field(description="How much of it; the unit is the perturbation's.")
    method: str = Field(description="The method that is tried.")
    seed: int = Field(default=0, ge=0, description="Seed of every random choice.")
