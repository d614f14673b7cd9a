"""What the factory will take for a folder of photographs on this machine."""

from __future__ import annotations

from collections.abc import Mapping
from statistics import median

from aug3d_core.factory.config import scene_config
from aug3d_core.factory.estimate.calibration import Calibration
from aug3d_core.factory.estimate.cost import Cost
from aug3d_core.factory.estimate.estimate import estimate_of, in_folds, total_of
from aug3d_core.factory.estimate.size import SceneSize
from aug3d_core.factory.material import Material
from aug3d_core.factory.plan import Step
from aug3d_core.look.survey import Survey

PRESETS = ("tiny", "small")


def costs_of(survey: Survey, calibration: Calibration) -> Mapping[str, Cost]:
    """Return what a whole run takes, by preset."""
    sizes = [photo.original_size for photo in survey.photos]
    pixels, aspect = (
        median(width * height for width, height in sizes),
        median(width / height for width, height in sizes),
    )
    size = SceneSize(len(sizes), float(pixels), survey.ground is not None, aspect)
    steps = [Step(stage) for stage in Material(photos=survey.folder).stages()]
    costs = {}
    for preset in PRESETS:
        config = scene_config(preset)
        each = estimate_of(config, size, calibration)
        costs[preset] = total_of([each[step.stage.name] for step in in_folds(steps, config, size)])
    return costs
