"""Configuration of the two stages that the study of stability adds to the factory's."""

from __future__ import annotations

from pydantic import Field

from aug3d_core.run.stage import Stage, StageConfig


class DamageConfig(StageConfig):
    """How the output of a stage is damaged before the next stage reads it."""

    damage: str = Field(description='"module:function" of the damage.')
    dose: float = Field(description="Amount, in the unit of the perturbation.")
    seed: int = Field(default=0, ge=0, le=2**31 - 1, description="Seed of every random choice.")

    @property
    def modules(self) -> tuple[str, ...]:
        """The code of this damage only."""
        return (self.damage,)


class ComputedConfig(StageConfig):
    """A cell without a stage of the factory: a function of dose, method and seed on an exactly known world."""

    compute: str = Field(description='"module:function" of what is computed.')
    dose: float = Field(description="Amount, in the unit of the perturbation.")
    method: str = Field(description="Method to try.")
    seed: int = Field(default=0, ge=0, le=2**31 - 1, description="Seed of every random choice.")

    @property
    def modules(self) -> tuple[str, ...]:
        """The code of this figure only."""
        return (self.compute,)


# Stages that only this study has
DAMAGED = Stage("damaged", DamageConfig, ("whole",), "aug3d_core.studies.stability.damage_stage:run", (), "dose")
COMPUTED = Stage("computed", ComputedConfig, (), "aug3d_core.studies.stability.compute_stage:run", (), "accuracy")
