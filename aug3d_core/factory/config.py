"""The configuration of a whole scene: one model per stage, four presets, and overrides by hand."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pydantic import Field, ValidationError, field_validator

from aug3d_core.dataset.config import DatasetConfig
from aug3d_core.depth.config import DepthConfig
from aug3d_core.domes.config import SamplingConfig
from aug3d_core.factory.stages import STAGES
from aug3d_core.groups.config import GroupingConfig, SimilarityConfig
from aug3d_core.heads.pixelnerf.config import EvaluationConfig, TrainingConfig
from aug3d_core.overlap.config import OverlapConfig
from aug3d_core.photos.config import PhotosConfig
from aug3d_core.poses.config import PosesConfig
from aug3d_core.rendering.config import RenderingConfig
from aug3d_core.run.errors import UsageError
from aug3d_core.run.stage import Frozen
from aug3d_core.sfm.config import MatchingConfig, SfmConfig
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.town.config import MeshTruthConfig, TownConfig, TruthConfig

AUTO = "auto"
PRESETS = ("tiny", "small", "paper", AUTO)
SIZES = f"Size of everything: {', '.join(PRESETS[:-1])}; or {AUTO}, no more than the scene needs."
_BASE = "tiny"  # where `auto` starts from; the size of what is predicted, dataset.width_px, stays the user's choice
LEFT_OPEN = tuple(f"{stage.name}.{field}" for stage in STAGES.values() for field in stage.decidable)


def _settings_of(stage: str) -> Any:
    return Field(description=STAGES[stage].description)


class SceneConfig(Frozen):
    """Every setting of the factory, stage by stage."""

    town: TownConfig = _settings_of("town")
    photos: PhotosConfig = _settings_of("photos")
    poses: PosesConfig = _settings_of("poses")
    matching: MatchingConfig = _settings_of("matching")
    sfm: SfmConfig = _settings_of("sfm")
    truth: TruthConfig = _settings_of("truth")
    similarity: SimilarityConfig = _settings_of("similarity")
    grouping: GroupingConfig = _settings_of("grouping")
    overlap: OverlapConfig = _settings_of("overlap")
    depth: DepthConfig = _settings_of("depth")
    surface: SurfaceConfig = _settings_of("surface")
    mesh_truth: MeshTruthConfig = _settings_of("mesh_truth")
    sampling: SamplingConfig = _settings_of("sampling")
    rendering: RenderingConfig = _settings_of("rendering")
    dataset: DatasetConfig = _settings_of("dataset")
    training: TrainingConfig = _settings_of("training")
    evaluation: EvaluationConfig = _settings_of("evaluation")
    auto: tuple[str, ...] = Field(
        default=(),
        description="Settings (stage.field) that are decided from the scene when their stage comes, unless they are set "
        "to something else than the preset auto has.",
    )

    @field_validator("auto")
    @classmethod
    def _can_be_left_open(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if unknown := [name for name in names if name not in LEFT_OPEN]:
            raise ValueError(f"nothing decides {unknown[0]}: choose of {', '.join(LEFT_OPEN)}")
        return names


def scene_config(preset: str, overrides: Iterable[str] = ()) -> SceneConfig:
    """Return a preset with overrides of the form `stage.field=value`; raises UsageError naming the wrong one."""
    if preset not in PRESETS:
        raise UsageError(f"there is no preset {preset!r}", f"choose one of {', '.join(PRESETS)}")
    return overridden(_preset(preset), overrides)


def overridden(config: SceneConfig, overrides: Iterable[str]) -> SceneConfig:
    """Return a configuration with overrides of the form `stage.field=value`; raises UsageError naming the wrong one."""
    values = config.model_dump()
    for override in overrides:
        _override(values, override)
    return validated_config(values)


def left_open(config: SceneConfig, stage: str) -> tuple[str, ...]:
    """Return the fields of a stage that are to be decided: on the list, and not set to something else by hand."""
    named = [name.partition(".")[2] for name in config.auto if name.partition(".")[0] == stage]
    if not named:
        return ()
    chosen, base = getattr(config, stage), getattr(_preset(AUTO), stage)
    return tuple(field for field in named if getattr(chosen, field) == getattr(base, field))


def validated_config(values: dict[str, Any]) -> SceneConfig:
    """Check values from outside; raises UsageError that names each wrong field, its value and its bounds."""
    try:
        return SceneConfig.model_validate(values)
    except ValidationError as error:
        wrong = "; ".join(
            f"{'.'.join(map(str, e['loc']))}={e['input']!r}: {e['msg'].lower()}"
            for e in error.errors(include_url=False)
        )
        raise UsageError(
            f"the configuration is not valid: {wrong}", "mend the value, or leave it out to use the preset's"
        ) from error


def _preset(name: str) -> SceneConfig:
    if name == AUTO:
        base = _preset(_BASE)
        return base.model_copy(update={"auto": LEFT_OPEN, "grouping": base.grouping.model_copy(update={"k": "auto"})})
    return SceneConfig.model_validate({stage.name: stage.presets[name] for stage in STAGES.values() if stage.presets})


def _override(values: dict[str, Any], override: str) -> None:
    path, equals, text = override.partition("=")
    stage, _, field = path.partition(".")
    stages = [name for name in values if name != "auto"]
    if not equals or not field:
        raise UsageError(
            f"--set {override!r} is not of the form stage.field=value", "write for example --set training.steps=500"
        )
    if stage not in stages:
        raise UsageError(f"--set {override!r}: there is no stage {stage!r}", f"choose one of {', '.join(stages)}")
    if field not in values[stage]:
        known = ", ".join(values[stage]) or "none"
        raise UsageError(f"--set {override!r}: stage {stage} has no field {field!r}", f"its fields are: {known}")
    values[stage][field] = None if text.lower() in ("none", "null") else text
    values["auto"] = tuple(name for name in values["auto"] if name != path)  # whoever sets it decides it
