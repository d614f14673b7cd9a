"""The configuration of a whole scene: one model per stage, four presets, and overrides by hand."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pydantic import Field, ValidationError, field_validator

from aug3d_core.dataset import config as _dataset
from aug3d_core.depth import config as _depth
from aug3d_core.errors import UsageError
from aug3d_core.formats import config as _formats
from aug3d_core.grouping import config as _grouping
from aug3d_core.needs.settings import LEFT_OPEN
from aug3d_core.nerf import config as _nerf
from aug3d_core.photos import config as _photos
from aug3d_core.rendering import config as _rendering
from aug3d_core.sampling import config as _sampling
from aug3d_core.sfm import config as _sfm
from aug3d_core.stage import Frozen
from aug3d_core.surface import config as _surface
from aug3d_core.testbed import config as _testbed

AUTO = "auto"
PRESETS = ("tiny", "small", "paper", AUTO)
SIZES = f"Size of everything: {', '.join(PRESETS[:-1])}; or {AUTO}, no more than the scene needs."
_BASE = "tiny"  # where `auto` starts from; the size of what is predicted, dataset.width_px, stays the user's choice


class SceneConfig(Frozen):
    """Every setting of the factory, stage by stage."""

    town: _testbed.TownConfig = Field(description="The built-in town; used when there are no photographs.")
    photos: _photos.PhotosConfig = Field(description="Finding and checking photographs.")
    poses: _formats.PosesConfig = Field(description="Camera poses that were given.")
    matching: _sfm.MatchingConfig = Field(description="Features, and which photographs show the same thing.")
    sfm: _sfm.SfmConfig = Field(description="Structure from motion.")
    truth: _testbed.TruthConfig = Field(description="Comparison with the town's truth.")
    similarity: _grouping.SimilarityConfig = Field(description="The similarity matrix.")
    grouping: _grouping.GroupingConfig = Field(description="Groups of K photographs, and the test split.")
    overlap: _grouping.OverlapConfig = Field(description="What members of groups really see alike, by every way.")
    depth: _depth.DepthConfig = Field(description="A depth map of each photograph, and fused points.")
    surface: _surface.SurfaceConfig = Field(description="The mesh.")
    mesh_truth: _testbed.MeshTruthConfig = Field(description="Comparison of the mesh with the town's truth.")
    sampling: _sampling.SamplingConfig = Field(description="Virtual camera domes.")
    rendering: _rendering.RenderingConfig = Field(description="Cycles renders.")
    dataset: _dataset.DatasetConfig = Field(description="The packed data set.")
    training: _nerf.TrainingConfig = Field(description="PixelNeRF training.")
    evaluation: _nerf.EvaluationConfig = Field(description="PSNR on held-out photographs.")
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
    return SceneConfig(
        town=_testbed.PRESETS[name],
        photos=_photos.PRESETS[name],
        poses=_formats.PRESETS[name],
        matching=_sfm.MATCHING_PRESETS[name],
        sfm=_sfm.PRESETS[name],
        truth=_testbed.TRUTH_PRESETS[name],
        similarity=_grouping.SIMILARITY_PRESETS[name],
        grouping=_grouping.GROUPING_PRESETS[name],
        overlap=_grouping.OVERLAP_PRESETS[name],
        depth=_depth.PRESETS[name],
        surface=_surface.PRESETS[name],
        mesh_truth=_testbed.MESH_TRUTH_PRESETS[name],
        sampling=_sampling.PRESETS[name],
        rendering=_rendering.PRESETS[name],
        dataset=_dataset.PRESETS[name],
        training=_nerf.TRAINING_PRESETS[name],
        evaluation=_nerf.EVALUATION_PRESETS[name],
    )


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
