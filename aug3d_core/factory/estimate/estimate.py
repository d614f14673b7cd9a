"""What the steps of a run will take on this machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

from aug3d_core.factory.config import SceneConfig, scene_config
from aug3d_core.factory.estimate.calibration import REFERENCE, Calibration, Told, calibration_of
from aug3d_core.factory.estimate.cost import Cost, Range, about, together
from aug3d_core.factory.estimate.laws import LAWS, Figures, Scene, law_of, scene_here
from aug3d_core.factory.estimate.likely import likely_settings
from aug3d_core.factory.estimate.size import SceneSize, size_of
from aug3d_core.factory.material import Material
from aug3d_core.factory.plan import Step, later_folds_of
from aug3d_core.factory.stages import GROUPING
from aug3d_core.factory.walk import Visit
from aug3d_core.store.store import Store

# By how much an estimate may be wrong
_KNOWN, _NEW = 1.3, 1.7  # time: of a stage that this machine has made, and of another
_STEADY, _STEADY_NEW = 1.15, 1.4  # memory and disk, which depend less on the machine and on what else runs
_OPEN = 1.4  # further, where settings are decided from the scene later: one of a stage changes the work of the next
_AWAY = 0.12  # power of how many times more or less work it is than what tells of it
_FITTED = SceneSize(60, 640 * 480)  # the town of the demo, on which most laws were fitted
_FEW_TARGETS = 10.5  # photographs; with fewer in its test's share a scene is made in two folds: 4 targets need 11


@dataclass(frozen=True)
class PlanEstimate:
    """What a run will take. steps: by name, in order; None for what is there. told: what it was calibrated by.

    folds: how many the total counts of what is made once for each fold. open_fields: settings that are decided later.
    """

    steps: Mapping[str, Cost | None]
    total: Cost
    folds: int
    told: str
    open_fields: tuple[str, ...]


def estimate_of(
    config: SceneConfig, size: SceneSize, calibration: Calibration = REFERENCE, cores: int | None = None
) -> Mapping[str, Cost]:
    """Return what each stage takes, in one fold, by the stage's name.

    cores: that it may use, None for those of this process.
    """
    scene = scene_here(config, size, cores)
    return {stage: _cost(stage, scene, calibration) for stage in LAWS}


def estimate_plan(
    store: Store, material: Material, config: SceneConfig, plan: Sequence[Visit], *, timed: bool = True
) -> PlanEstimate:
    """Return what a run will take; raises InputError if there are no photographs to be counted.

    timed: work a little to know a machine that has made too little yet.
    """
    made = {visit.step.name: visit.record for visit in plan if visit.record}
    missing = [visit.step for visit in plan if visit.record is None]
    if not missing:
        return PlanEstimate({visit.step.name: None for visit in plan}, total_of(()), 1, "", ())
    size = size_of(material, config, made, store)
    chosen = likely_settings(config, size, plan, store, material)
    calibration = calibration_of(store, timed=timed)
    costs = estimate_of(chosen, size, calibration)
    counted = in_folds(missing, chosen, size)
    return PlanEstimate(
        {visit.step.name: None if visit.record else costs[visit.step.stage.name] for visit in plan},
        total_of([costs[step.stage.name] for step in counted]),
        1 + max((step.fold for step in counted), default=0),
        calibration.told,
        chosen.auto,
    )


def total_of(costs: Sequence[Cost]) -> Cost:
    """Return what steps take together: one after the other, so that memory is that of the largest."""
    peaks = [cost.peak_mib for cost in costs] or [Range(0, 0, 0)]
    peak = Range(*(max(getattr(one, end) for one in peaks) for end in ("low", "likely", "high")))
    return Cost(together(cost.seconds for cost in costs), peak, together(cost.disk_mib for cost in costs))


def in_folds(missing: Sequence[Step], config: SceneConfig, size: SceneSize) -> Sequence[Step]:
    """Return steps with those of the folds that a split which is still to be made is likely to have."""
    if GROUPING.name not in {step.name for step in missing}:
        return missing
    grouping = config.grouping
    folds = grouping.folds or (2 if grouping.test_share * size.photos < _FEW_TARGETS else 1)
    return [*missing, *later_folds_of((step.stage for step in missing), folds)]


def _cost(stage: str, scene: Scene, calibration: Calibration) -> Cost:
    law = law_of(stage, scene)
    known = calibration.of(stage, law)
    told = known or Told(Figures(calibration.slowness, 1.0, 1.0), law_of(stage, _fitted_on(scene)))
    open_too = _OPEN if scene.config.auto else 1.0

    def ranged(figure: str, factor: float) -> Range:
        says, ratio, of = (getattr(one, figure) for one in (law, told.ratio, told.law))
        return about(says * ratio, factor * open_too * max(says / of, of / says) ** _AWAY)

    time, steady = (_KNOWN, _STEADY) if known else (_NEW, _STEADY_NEW)
    return Cost(ranged("seconds", time), ranged("peak_mib", steady), ranged("disk_mib", steady))


def _fitted_on(scene: Scene) -> Scene:
    return replace(scene, config=_usual(), size=_FITTED)


@cache
def _usual() -> SceneConfig:
    return scene_config("tiny")
