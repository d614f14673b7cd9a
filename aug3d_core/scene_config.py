"""The configuration of a whole scene: one model per stage, three presets, and overrides by hand."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pydantic import Field, ValidationError

from aug3d_core.dataset import config as dataset
from aug3d_core.errors import UsageError
from aug3d_core.grouping import config as grouping
from aug3d_core.nerf import config as nerf
from aug3d_core.photos import config as photos
from aug3d_core.rendering import config as rendering
from aug3d_core.sampling import config as sampling
from aug3d_core.sfm import config as sfm
from aug3d_core.stage import Frozen
from aug3d_core.surface import config as surface
from aug3d_core.testbed import config as testbed

PRESETS = ("tiny", "small", "paper")


class SceneConfig(Frozen):
    """Every setting of the factory, stage by stage."""

    town: testbed.TownConfig = Field(testbed.TownConfig(), description="The built-in town; used when there are no photographs")
    photos: photos.PhotosConfig = Field(photos.PhotosConfig(), description="Finding and checking photographs")
    sfm: sfm.SfmConfig = Field(sfm.SfmConfig(), description="Structure from motion")
    truth: testbed.TruthConfig = Field(testbed.TruthConfig(), description="Comparison with the town's truth")
    similarity: grouping.SimilarityConfig = Field(grouping.SimilarityConfig(), description="The similarity matrix")
    grouping: grouping.GroupingConfig = Field(grouping.GroupingConfig(), description="Groups of K photographs, and the test split")
    surface: surface.SurfaceConfig = Field(surface.SurfaceConfig(), description="The mesh")
    sampling: sampling.SamplingConfig = Field(sampling.SamplingConfig(), description="Virtual camera domes")
    rendering: rendering.RenderingConfig = Field(rendering.RenderingConfig(), description="Cycles renders")
    dataset: dataset.DatasetConfig = Field(dataset.DatasetConfig(), description="The packed data set")
    training: nerf.TrainingConfig = Field(nerf.TrainingConfig(), description="PixelNeRF training")
    evaluation: nerf.EvaluationConfig = Field(nerf.EvaluationConfig(), description="PSNR on held-out photographs")


def scene_config(preset: str, overrides: Iterable[str] = ()) -> SceneConfig:
    """Return a preset with overrides of the form `stage.field=value`; raises UsageError naming the wrong one."""
    if preset not in PRESETS:
        raise UsageError(f"there is no preset {preset!r}", f"choose one of {', '.join(PRESETS)}")
    values = _preset(preset).model_dump()
    for override in overrides:
        _override(values, override)
    return validated_config(values)


def validated_config(values: dict[str, Any]) -> SceneConfig:
    """Check values from outside; raises UsageError that names each wrong field, its value and its bounds."""
    try:
        return SceneConfig.model_validate(values)
    except ValidationError as error:
        wrong = "; ".join(
            f"{'.'.join(map(str, e['loc']))}={e['input']!r}: {e['msg'].lower()}" for e in error.errors(include_url=False)
        )
        raise UsageError(f"the configuration is not valid: {wrong}", "mend the value, or leave it out to use the preset's") from error


def _preset(name: str) -> SceneConfig:
    return SceneConfig(
        town=testbed.PRESETS[name],
        photos=photos.PRESETS[name],
        sfm=sfm.PRESETS[name],
        similarity=grouping.SIMILARITY_PRESETS[name],
        grouping=grouping.GROUPING_PRESETS[name],
        surface=surface.PRESETS[name],
        sampling=sampling.PRESETS[name],
        rendering=rendering.PRESETS[name],
        dataset=dataset.PRESETS[name],
        training=nerf.TRAINING_PRESETS[name],
        evaluation=nerf.EVALUATION_PRESETS[name],
    )


def _override(values: dict[str, Any], override: str) -> None:
    path, equals, text = override.partition("=")
    stage, _, field = path.partition(".")
    if not equals or not field:
        raise UsageError(f"--set {override!r} is not of the form stage.field=value", "write for example --set training.steps=500")
    if stage not in values:
        raise UsageError(f"--set {override!r}: there is no stage {stage!r}", f"choose one of {', '.join(values)}")
    if field not in values[stage]:
        known = ", ".join(values[stage]) or "none"
        raise UsageError(f"--set {override!r}: stage {stage} has no field {field!r}", f"its fields are: {known}")
    values[stage][field] = None if text.lower() in ("none", "null") else text
