"""The content of one collection file."""

from __future__ import annotations

from typing import Any

from pydantic import Field, field_validator, model_validator

from aug3d_core.factory.config import AUTO, PRESETS, SceneConfig, validated_config, with_settings
from aug3d_core.run.errors import UsageError
from aug3d_core.run.stage import Frozen
from aug3d_core.scene_files import Publishing, Schedule
from aug3d_core.store.scene_name import check_scene_name

STAGES = ("training", "evaluation")  # what a collection sets; all else is each scene's own


class CollectionEntry(Frozen):
    """Which scenes play which part, and how one model is trained and judged on them."""

    train: tuple[str, ...] = Field(default=(), description="Scenes of the registry that the model is trained on.")
    hold_out: tuple[str, ...] = Field(
        default=(), description="Scenes of the registry that it never sees: it is judged on their test photographs."
    )
    towns: int = Field(
        default=0, ge=0, le=10_000, description="Made-up towns that it is trained on besides, packed from their truth."
    )
    towns_seed: int = Field(default=0, ge=0, le=2**31 - 1, description="Seed of these towns.")
    preset: str = Field(default="tiny", description="Size of the training.")
    settings: dict[str, dict[str, Any]] = Field(
        default={}, description="Settings of the stages training and evaluation that differ from the preset's."
    )
    description: str = Field(default="", description="A sentence for lists of collections.")
    schedule: Schedule | None = Field(default=None, description="When to train it again automatically.")
    publish: Publishing = Field(default=Publishing(), description="When a new version is published.")

    @field_validator("train", "hold_out")
    @classmethod
    def _are_scene_names(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            try:
                check_scene_name(name)
            except UsageError as error:
                raise ValueError(f"{error.problem}: {error.remedy}") from error
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"names {twice[0]} twice")
        return names

    @field_validator("preset")
    @classmethod
    def _preset_is_a_size(cls, preset: str) -> str:
        if preset not in PRESETS or preset == AUTO:
            raise ValueError(f"is not a size: choose one of {', '.join(name for name in PRESETS if name != AUTO)}")
        return preset

    @field_validator("settings")
    @classmethod
    def _are_of_its_stages(cls, settings: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        if other := [stage for stage in settings if stage not in STAGES]:
            raise ValueError(f"sets {other[0]}, which is each scene's own: write it into the files of the scenes")
        return settings

    @model_validator(mode="after")
    def _has_parts(self) -> CollectionEntry:
        if both := [name for name in self.train if name in self.hold_out]:
            raise ValueError(f"scene {both[0]} is to be trained on and held out: it can play one part")
        if not self.train and not self.towns:
            raise ValueError("there is nothing to train on: name scenes under train, or a number of towns")
        return self

    def config(self) -> SceneConfig:
        """Return the settings of training and evaluation, among others that nobody reads."""
        return validated_config(with_settings(self.preset, self.settings))
