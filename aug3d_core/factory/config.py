"""The configuration of a whole scene: one model per stage, four presets, and overrides by hand."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import Field, ValidationError, field_validator

from aug3d_core.dataset.config import DatasetConfig
from aug3d_core.depth.config import DepthConfig
from aug3d_core.domes.config import SamplingConfig
from aug3d_core.factory.stages import STAGES
from aug3d_core.groups.config import ENOUGH, GroupingConfig, SimilarityConfig
from aug3d_core.heads.config import config_of, names
from aug3d_core.judging.config import EvaluationConfig
from aug3d_core.overlap.config import OverlapConfig
from aug3d_core.photos.config import PhotosConfig
from aug3d_core.poses.config import PosesConfig
from aug3d_core.rendering.config import RenderingConfig
from aug3d_core.run.errors import UsageError, shown
from aug3d_core.run.nested import flat, merged, value_at, within
from aug3d_core.run.stage import Frozen
from aug3d_core.sfm.config import MatchingConfig, SfmConfig
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.town.config import MeshTruthConfig, TownConfig, TruthConfig
from aug3d_core.training.config import TrainingConfig, presets

AUTO = "auto"
PRESETS = ("tiny", "small", "paper", AUTO)
SIZES = f"Size of everything: {', '.join(PRESETS[:-1])}; or {AUTO}, no more than the scene needs."
_BASE = "tiny"  # where `auto` starts from; the size of what is predicted, dataset.width_px, stays the user's choice
LEFT_OPEN = tuple(f"{stage.name}.{field}" for stage in STAGES.values() for field in stage.decidable)


# Settings of earlier versions: files and scripts may still have them
GONE: Mapping[str, str] = {
    "evaluation.resamples": "intervals are no longer drawn at random: leave it out",
    "evaluation.seed": "nothing is random there any more: leave it out",
    "similarity.connected_points": "it is always 20 now: leave it out",
    "surface.photos_per_place": "it is always 3 now: leave it out",
}


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
    return overridden(_preset(preset), overrides, preset)


def overridden(config: SceneConfig, overrides: Iterable[str], preset: str = _BASE) -> SceneConfig:
    """Return a configuration with overrides of the form `stage.field=value`; raises UsageError naming the wrong one.

    preset: that of another head, where an override chooses one.
    """
    values = config.model_dump()
    for override in overrides:
        values = _overridden(values, override, preset)
    return validated_config(values)


def with_settings(preset: str, settings: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return a preset's values with settings of stages over them, not checked yet; raises UsageError for an unknown head.

    A setting that the preset leaves open is set by them.
    """
    values = scene_config(preset).model_dump()
    for stage, fields in settings.items():
        head = fields.get("head") if stage == "training" else None
        name = head.get("name") if isinstance(head, Mapping) else head
        if isinstance(name, str):
            values = _with_head(values, name, preset)
            fields = {**fields, "head": {"name": name, **(head if isinstance(head, Mapping) else {})}}
        values[stage] = merged(values.get(stage, {}), fields)
    set_here = flat(settings)
    return {**values, "auto": tuple(path for path in values["auto"] if path not in set_here)}


def left_open(config: SceneConfig, stage: str) -> tuple[str, ...]:
    """Return the fields of a stage that are to be decided: on the list, and not set to something else by hand."""
    named = [name.partition(".")[2] for name in config.auto if name.partition(".")[0] == stage]
    if not named:
        return ()
    base = _preset(AUTO, config.training.head.name)
    chosen, usual = (flat(getattr(one, stage).model_dump()) for one in (config, base))
    return tuple(field for field in named if field in chosen and chosen[field] == usual[field])


def validated_config(values: dict[str, Any]) -> SceneConfig:
    """Check values from outside; raises UsageError that names each wrong field, its value and its bounds."""
    try:
        return SceneConfig.model_validate(values)
    except ValidationError as error:
        whats: dict[str, list[str]] = {}
        for e in error.errors(include_url=False):
            name = ".".join(_written(place(e["loc"]), values))
            whats.setdefault(name if isinstance(e["input"], Mapping) else f"{name}={shown(e['input'])}", []).append(
                said(e)
            )
        wrong = "; ".join(f"{name}: {', or '.join(what)}" for name, what in whats.items())
        raise UsageError(
            f"the configuration is not valid: {wrong}", "correct the value, or leave it out to use the preset's"
        ) from error


def place(loc: Iterable[str | int]) -> tuple[str, ...]:
    """Return the path of a wrong setting from what pydantic tells: it puts the name of a head between `head` and its field."""
    named = tuple(map(str, loc))
    return tuple(name for n, name in enumerate(named) if not (n and named[n - 1] == "head" and name in names()))


def said(error: Mapping[str, Any]) -> str:
    """Say what is wrong with a value, as pydantic tells it in `errors()`, to people."""
    return {
        "string_type": "should be a text: put it in quotes",
        "tuple_type": "should be a list: [one, two]",
        "path_type": "should be a path",
        "dict_type": "should have fields of its own, each in a line below",
        "model_type": "should have fields of its own, each in a line below",
        "value_error": str(error.get("ctx", {}).get("error")),
    }.get(error["type"], f"{error['msg'][0].lower()}{error['msg'][1:]}")


def _written(path: tuple[str, ...], values: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the path without what pydantic adds to it: which kind of value it tried, where several are taken."""
    at: Any = values
    for depth, name in enumerate(path):
        if not isinstance(at, Mapping) or name not in at:
            return path[:depth]
        at = at[name]
    return path


def _preset(name: str, head: str | None = None) -> SceneConfig:
    if name == AUTO:
        base = _preset(_BASE, head)
        grouping = base.grouping.model_copy(update={"k": "auto", "enough": ENOUGH})
        return base.model_copy(update={"auto": LEFT_OPEN, "grouping": grouping})
    stages = {stage.name: stage.presets[name] for stage in STAGES.values() if stage.presets}
    return SceneConfig.model_validate(stages | {"training": presets(head)[name]})


def _overridden(values: dict[str, Any], override: str, preset: str) -> dict[str, Any]:
    path, equals, text = override.partition("=")
    stage, _, field = path.partition(".")
    stages = [name for name in values if name != "auto"]
    if not equals or not field:
        raise UsageError(
            f"--set {override!r} is not of the form stage.field=value", "write for example --set training.steps=500"
        )
    if stage not in stages:
        raise UsageError(f"--set {override!r}: there is no stage {stage!r}", f"choose one of {', '.join(stages)}")
    if path in ("training.head", "training.head.name"):
        return _with_head(values, text, preset)
    try:
        value_at(values, path)
    except KeyError as error:
        raise _unknown(values, override, stage, str(error.args[0])) from error
    value = None if text.lower() in ("none", "null") else text
    decided = tuple(name for name in values["auto"] if name != path)  # whoever sets it decides it
    return merged(values, within(path, value)) | {"auto": decided}


def _unknown(values: Mapping[str, Any], override: str, stage: str, path: str) -> UsageError:
    """Return the error of an override of a field that is not there, with the fields that are."""
    if path in GONE:
        return UsageError(f"--set {override!r}: there is no setting {path} any more", GONE[path])
    above, _, field = path.rpartition(".")
    beside = value_at(values, above)
    near = f"training.head.{field}"
    hint = f"did you mean {near}?" if above == "training" and field in values["training"]["head"] else ""
    if owner := next((name for name in names() if field in config_of(name).model_fields), ""):
        hint = hint or (
            f"it is a setting of another head: set training.head={owner} first" if above == "training.head" else ""
        )
    known = ", ".join(beside) if isinstance(beside, Mapping) and beside else "none"
    what = f"stage {stage}" if above == stage else above
    return UsageError(f"--set {override!r}: {what} has no field {field!r}", hint or f"its fields are: {known}")


def _with_head(values: dict[str, Any], name: str, preset: str) -> dict[str, Any]:
    """Return the values with another head, trained as the preset has it; those of the same head stay as they are."""
    if name not in names():
        raise UsageError(f"there is no head {name!r}", f"choose one of {', '.join(names())}")
    if values["training"]["head"]["name"] == name:
        return values
    return values | {"training": presets(name)[_BASE if preset == AUTO else preset].model_dump()}
