"""How a machine differs from the one that the laws were measured on: by what it has made, else by a little fixed work.

What it has made is the better source: the same stages, on the same disks, beside whatever else usually runs there.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from statistics import median

from aug3d_core.factory.config import SceneConfig, scene_config
from aug3d_core.factory.estimate.laws import LAWS, Scene
from aug3d_core.factory.estimate.size import SceneSize, size_of_record
from aug3d_core.run.errors import Aug3dError
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import records_of, version_metrics
from aug3d_core.store.store import Store

_VERSIONS = 8  # the newest ones of a home that are looked at
_NEWEST = 3  # records of a stage that count
_ENOUGH = 3  # stages that tell how fast a machine is with the others
_GREW = ("photos_reused", "grown_from")  # metrics of a record that extended an earlier one, which costs less
_REPEATS = 9
_REFERENCE_S = 0.077  # what the fixed work took on the reference machine, processor seconds
_MIB = 2**20


@dataclass(frozen=True)
class Ratio:
    """What a stage takes here over what its law says."""

    seconds: float = 1.0
    peak_mib: float = 1.0
    disk_mib: float = 1.0


@dataclass(frozen=True)
class Calibration:
    """What is known of this machine. of_stages: by what it has made. others: of every other stage. told: one line on it.

    photos: of the scene that it was taken from, 0 if it was taken from none.
    """

    of_stages: Mapping[str, Ratio] = field(default_factory=dict)
    others: Ratio = Ratio()
    photos: float = 0.0
    told: str = "for the machine that the laws were measured on"

    def of(self, stage: str) -> Ratio:
        """Return the ratio of a stage."""
        return self.of_stages.get(stage, self.others)


REFERENCE = Calibration()  # for the machine that the laws were measured on


@dataclass(frozen=True)
class Sample:
    """Something that was made: its record, and the settings and size of its scene."""

    record: Record
    config: SceneConfig
    size: SceneSize


def calibration_of(store: Store, *, timed: bool = True) -> Calibration:
    """Return what the newest versions of a home tell of this machine, and where they tell too little, a little work.

    timed: whether anybody asks for times; no work is done for memory and disk.
    """
    return calibration_by(list(samples_of(store)), timed=timed)


def calibration_by(samples: Sequence[Sample], *, timed: bool = True) -> Calibration:
    """Return what samples, newest first, tell of the machine that made them."""
    cores = available_cores()
    by_stage: dict[str, list[Ratio]] = {}
    for sample in samples:
        if not any(sample.record.metrics.get(name) for name in _GREW):
            by_stage.setdefault(sample.record.stage, []).append(ratio_of(sample, cores))
    ratios = {stage: _median(found[:_NEWEST]) for stage, found in by_stage.items()}
    photos = median(sample.size.photos for sample in samples) if samples else 0.0
    if len(ratios) >= _ENOUGH:
        told = f"from {sum(len(found[:_NEWEST]) for found in by_stage.values())} stages that this machine made"
        return Calibration(ratios, Ratio(seconds=median(ratio.seconds for ratio in ratios.values())), photos, told)
    if not timed:
        return Calibration(ratios, photos=photos)
    seconds = fixed_work_s()
    told = f"from {_REPEATS * seconds:.1f} s of calibration: this machine has made too little yet"
    return Calibration(ratios, Ratio(seconds=seconds / _REFERENCE_S), photos, told)


def ratio_of(sample: Sample, cores: int) -> Ratio:
    """Return what a sample took over what the law of its stage says."""
    record, work = sample.record, LAWS[sample.record.stage](Scene(sample.config, sample.size, cores))
    return Ratio(
        record.seconds / work.seconds(cores), record.peak_mib / work.peak_mib, record.size_bytes / _MIB / work.disk_mib
    )


def samples_of(store: Store) -> Iterator[Sample]:
    """Yield what the newest versions of a home hold, newest first, each object once."""
    seen: set[str] = set()
    found = (store.root / layout.SCENES).glob(f"*/*/{layout.METRICS}")
    for path in sorted(found, key=lambda path: path.parent.name, reverse=True)[:_VERSIONS]:
        for sample in _samples_of_version(store, path.parent):
            if sample.record.key not in seen:
                seen.add(sample.record.key)
                yield sample


def samples_of_records(records: Mapping[str, Record]) -> Iterator[Sample]:
    """Yield the objects of one scene, by step, with the settings and the size that they have in common."""
    if "photos" not in records:
        return
    size = size_of_record(records["photos"])
    settings = {record.stage: record.config for step, record in records.items() if step == record.stage}
    config = SceneConfig.model_validate({**scene_config("tiny").model_dump(), **settings})
    for record in records.values():
        if record.stage in LAWS:
            yield Sample(record, config, size)


def available_cores() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0))


def _samples_of_version(store: Store, version: Path) -> list[Sample]:
    try:
        return list(samples_of_records(records_of(store, version_metrics(version))))
    except (Aug3dError, ValueError, KeyError, OSError):
        return []  # damaged, or made by a version of aug3d whose settings were others: it tells nothing


def _median(ratios: list[Ratio]) -> Ratio:
    return Ratio(*(median(getattr(ratio, name) for ratio in ratios) for name in ("seconds", "peak_mib", "disk_mib")))


@cache
def fixed_work_s() -> float:
    """Return the processor seconds of a fixed piece of work: the median of a few repeats.

    It is on one thread: arithmetic on arrays that leave the cache, sorting, and plain Python.
    """
    import numpy as np

    values = np.random.default_rng(0).random(1_000_000, np.float32)
    taken = []
    for _ in range(_REPEATS):
        started = time.thread_time()
        for _ in range(10):
            np.sqrt(values * values + 1.0).sum()
        np.sort(values)
        np.convolve(values[:100_000], values[:50])
        sum(i * i for i in range(500_000))
        taken.append(time.thread_time() - started)
    return median(taken)
