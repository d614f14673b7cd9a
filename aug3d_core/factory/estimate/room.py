"""Refuse a run that does not fit on this machine before anything is computed, and name a setting with which it would.

Disk: a step is expected to write at most twice what it wrote for the scene's last version, as many times more as its law says
of a scene that has grown or has other settings; else what its law says at the most. That errs to the large side, since a full
disk stops a run late. Memory: a run is refused only if a stage needs more even at the low end of its estimate, since what is
merely likely may as well go well.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence

from aug3d_core.factory.config import SceneConfig, overridden
from aug3d_core.factory.estimate.calibration import Calibration, Sample, calibration_of, samples_of_records, told_by
from aug3d_core.factory.estimate.estimate import estimate_of, in_folds
from aug3d_core.factory.estimate.laws import Scene, law_of, scene_here
from aug3d_core.factory.estimate.likely import likely_settings
from aug3d_core.factory.estimate.size import SceneSize, size_of
from aug3d_core.factory.material import Material
from aug3d_core.factory.plan import Step
from aug3d_core.factory.walk import Visit
from aug3d_core.run.errors import InputError, StoreError, TooLarge, UsageError
from aug3d_core.run.limits import LIMIT_MEMORY, limits_from
from aug3d_core.run.nested import flat, merged, nested, value_at
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store

_MIB = 2**20
_SPARE_MIB = 64.0  # the report, MLflow's copy of it, databases, logs
_TOO_FAR = 64.0  # times more or less to write: what was written tells nothing of that
# What makes a run smaller, and by how much it is tried
_SETTINGS = (
    "depth.max_px", "photos.max_px", "matching.max_features", "training.head.crop_px", "training.head.rays_per_group",
    "training.groups_per_step", "sampling.domes", "surface.texel_budget",
)  # fmt: skip
_SHARES = (0.75, 0.5, 0.375, 0.25, 0.125)


def check_room(
    store: Store,
    scene: str,
    material: Material,
    config: SceneConfig,
    before: Mapping[str, Record],
    plan: Sequence[Visit],
) -> None:
    """Raise TooLarge if a stage cannot fit into the memory, StoreError if the run may not fit on the store's disk.

    before: the records of the scene's last version by step.
    """
    missing = [visit.step for visit in plan if visit.record is None]
    if not missing:
        return
    try:
        size = size_of(material, config, {visit.step.name: visit.record for visit in plan if visit.record}, store)
    except InputError:
        return  # the stage that cannot read the photographs reports it
    config = likely_settings(config, size, plan, store, material)
    calibration = calibration_of(store, timed=False)
    _check_memory(scene, config, size, calibration, missing)
    _check_disk(store, scene, config, size, calibration, before, missing)


def needed_bytes(
    store: Store, material: Material, config: SceneConfig, before: Mapping[str, Record], missing: Sequence[Step]
) -> int:
    """Return what a run may write in the steps that are missing; 0 if none is, or the photographs cannot be read."""
    try:
        size = size_of(material, config, {})
        config = likely_settings(config, size, (), store, material)
    except InputError:
        return 0
    last = _last_of(store, before)
    return int(_needed_mib(config, size, calibration_of(store, timed=False), last, missing) * _MIB) if missing else 0


def size_words(size_bytes: float) -> str:
    """Return a size as people read it."""
    return f"{size_bytes / 2**30:.1f} GiB" if size_bytes >= 2**30 else f"{size_bytes / _MIB:.0f} MiB"


def _check_memory(
    scene: str, config: SceneConfig, size: SceneSize, calibration: Calibration, missing: Sequence[Step]
) -> None:
    limit_mib = limits_from(os.environ).mib
    stages = {step.stage.name for step in missing}

    def least_mib(config: SceneConfig) -> dict[str, float]:
        costs = estimate_of(config, size, calibration)
        return {stage: costs[stage].peak_mib.low for stage in costs if stage in stages}

    stage, needed = max(least_mib(config).items(), key=lambda item: item[1])
    if needed > limit_mib:
        way = _way_out(config, lambda changed: max(least_mib(changed).values()) <= limit_mib)
        raise TooLarge(
            f"stage {stage} of scene {scene!r} needs {size_words(needed * _MIB)} of memory or more, of which a stage may use"
            f" {size_words(limit_mib * _MIB)} here",
            f"{way}, run it on a machine with more memory, or allow it more with {LIMIT_MEMORY}",
        )


def _check_disk(
    store: Store,
    scene: str,
    config: SceneConfig,
    size: SceneSize,
    calibration: Calibration,
    before: Mapping[str, Record],
    missing: Sequence[Step],
) -> None:
    free, last = shutil.disk_usage(store.root).free, _last_of(store, before)
    needed = _needed_mib(config, size, calibration, last, missing) * _MIB
    if needed > free:
        way = _way_out(config, lambda changed: _needed_mib(changed, size, calibration, last, missing) * _MIB <= free)
        raise StoreError(
            f"scene {scene!r} may need {size_words(needed)} on the disk of {store.root}, where {size_words(free)} are free",
            f"free space with aug3d gc, choose another disk with --home DIR, or {way}",
        )


def _needed_mib(
    config: SceneConfig,
    size: SceneSize,
    calibration: Calibration,
    last: Mapping[str, Sample],
    missing: Sequence[Step],
) -> float:
    """Return what the missing steps may write; temporary files too, as much as the largest of them once more.

    last: the steps of the scene's last version.
    """
    costs = estimate_of(config, size, calibration)
    scenes = [scene_here(one, size) for one in _decided(config, last)]
    each, unknown = [], []
    for step in in_folds(missing, config, size):
        sample = last.get(step.name) or last.get(step.stage.name)
        known = _known_mib(sample, scenes) if sample else None
        each.append(costs[step.stage.name].disk_mib.high if known is None else known)
        unknown += each[-1:] if known is None else []
    return sum(each) + max(unknown, default=0.0) + _SPARE_MIB


def _known_mib(sample: Sample, scenes: Sequence[Scene]) -> float | None:
    """Return what a step may write in the largest of scenes by what it wrote last time, None if they are too unlike."""
    told = told_by(sample)
    law_mib = max(law_of(sample.record.stage, scene).disk_mib for scene in scenes)
    alike = 1 / _TOO_FAR < law_mib / told.law.disk_mib < _TOO_FAR
    return 2 * told.ratio.disk_mib * law_mib if alike else None


def _last_of(store: Store, before: Mapping[str, Record]) -> Mapping[str, Sample]:
    """Return the steps of a scene's last version; none if its settings are of a version of aug3d that had others."""
    try:
        samples = list(samples_of_records(before, store))
    except ValueError:
        return {}
    return {step: sample for step, record in before.items() for sample in samples if sample.record is record}


def _decided(config: SceneConfig, last: Mapping[str, Sample]) -> Sequence[SceneConfig]:
    """Return the likely settings, and the same with what was decided last time where they are still open."""
    then = next((flat(sample.config.model_dump()) for sample in last.values()), {})
    values = {path: then[path] for path in config.auto if path in then}
    return [config, SceneConfig.model_validate(merged(config.model_dump(), nested(values)))] if values else [config]


def _way_out(config: SceneConfig, fits: Callable[[SceneConfig], bool]) -> str:
    """Return which setting alone makes a run fit, the nearest to what was asked for."""
    for path, value, changed in _smaller(config):
        if fits(changed):
            return f"make it smaller with --set {path}={value}"
    return "use a smaller preset, or fewer photographs"


def _smaller(config: SceneConfig) -> Iterator[tuple[str, int, SceneConfig]]:
    values = config.model_dump()
    for share in _SHARES:
        for path in _SETTINGS:
            try:
                value = int(value_at(values, path) * share)
                yield path, value, overridden(config, [f"{path}={value}"])
            except (KeyError, UsageError):
                continue  # of another head, or below what it may be
