"""How a machine differs from the one that the laws were measured on: by what it has made, else by a little fixed work.

What it has made is the better source: the same stages, on the same disks, beside whatever else usually runs there.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from statistics import median

from aug3d_core.factory.config import SceneConfig, scene_config
from aug3d_core.factory.estimate.laws import LAWS, Figures, law_of, scene_here
from aug3d_core.factory.estimate.size import SceneSize, size_of_record
from aug3d_core.run.errors import Aug3dError
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import records_of, version_metrics
from aug3d_core.store.store import Store

_VERSIONS = 8  # the newest ones of a home that are looked at
_NEWEST = 3  # records of a stage that count
_ALIKE = 4.0  # times more or less work that is as good as the same
_TOO_FAR = 3  # times so much further tells nothing
_ENOUGH = 3  # stages that tell how fast a machine is with the others
_REPEATS = 9
_REFERENCE_S = 0.040  # what the fixed work took on the reference machine, processor seconds
_MIB = 2**20


@dataclass(frozen=True)
class Told:
    """What a record tells of a machine: what it took over what the law says, and what the law says of it."""

    ratio: Figures
    law: Figures


@dataclass(frozen=True)
class Calibration:
    """What is known of this machine.

    of_stages: by what it has made, newest first. slowness: what any other stage takes here over what its law says. told: where
    that is from.
    """

    of_stages: Mapping[str, Sequence[Told]] = field(default_factory=dict)
    slowness: float = 1.0
    told: str = "for the machine that the laws were measured on"

    def of(self, stage: str, law: Figures) -> Told | None:
        """Return what the newest records of a stage tell of work of this size, by those of the likest; None: nothing."""
        apart: dict[int, list[Told]] = {}
        for told in self.of_stages.get(stage, ()):
            apart.setdefault(int(abs(math.log(law.seconds / told.law.seconds, _ALIKE))), []).append(told)
        nearest = min(apart, default=_TOO_FAR)
        return _median(apart[nearest][:_NEWEST]) if nearest < _TOO_FAR else None


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
    by_stage: dict[str, list[Told]] = {}
    for sample in samples:
        if not sample.record.grew:  # that cost less
            by_stage.setdefault(sample.record.stage, []).append(told_by(sample))
    if len(by_stage) >= _ENOUGH:
        told = f"from {sum(map(len, by_stage.values()))} stages that this machine made"
        slowness = median(median(one.ratio.seconds for one in found) for found in by_stage.values())
        return Calibration(by_stage, slowness, told)
    if not timed:
        return Calibration(by_stage)
    seconds = fixed_work_s()
    told = f"from {_REPEATS * seconds:.1f} s of calibration: this machine has made too little yet"
    return Calibration(by_stage, seconds / _REFERENCE_S, told)


def told_by(sample: Sample) -> Told:
    """Return what a sample tells of the machine that made it."""
    record, law = sample.record, law_of(sample.record.stage, scene_here(sample.config, sample.size))
    disk_mib = record.size_bytes / _MIB
    return Told(Figures(record.seconds / law.seconds, record.peak_mib / law.peak_mib, disk_mib / law.disk_mib), law)


def samples_of(store: Store) -> Iterator[Sample]:
    """Yield what the newest versions of a home hold, newest first, each object once."""
    seen: set[str] = set()
    found = (store.root / layout.SCENES).glob(f"*/*/{layout.METRICS}")
    for path in sorted(found, key=lambda path: path.parent.name, reverse=True)[:_VERSIONS]:
        for sample in _samples_of_version(store, path.parent):
            if sample.record.key not in seen:
                seen.add(sample.record.key)
                yield sample


def samples_of_records(records: Mapping[str, Record], store: Store | None = None) -> Iterator[Sample]:
    """Yield the objects of one scene, by step, with the settings and the size that they have in common.

    store: where they are; without it photographs are taken for 4 x 3.
    """
    if "photos" not in records:
        return
    size = size_of_record(records["photos"], store)
    settings = {record.stage: record.config for step, record in records.items() if step == record.stage}
    config = SceneConfig.model_validate({**scene_config("tiny").model_dump(), **settings})
    for record in records.values():
        if record.stage in LAWS:
            yield Sample(record, config, size)


def _samples_of_version(store: Store, version: Path) -> list[Sample]:
    try:
        metrics = version_metrics(version)
        if store.shared is not None and Path(metrics["paths"]["metrics"]).parent != version:
            return []  # of another machine
        samples = samples_of_records(records_of(store, metrics), store)
        if store.shared is None:
            return list(samples)
        made = {step for step, figures in metrics["stages"].items() if not figures["cached"]}
        keys = {metrics["objects"][step]["key"] for step in made}
        return [sample for sample in samples if sample.record.key in keys]  # of the others nobody knows who made them
    except (Aug3dError, ValueError, KeyError, OSError):
        return []  # damaged, or made by a version of aug3d whose settings were others: it tells nothing


def _median(told: Sequence[Told]) -> Told:
    return Told(*(_median_of([getattr(one, which) for one in told]) for which in ("ratio", "law")))


def _median_of(figures: Sequence[Figures]) -> Figures:
    return Figures(*(median(getattr(one, name.name) for one in figures) for name in fields(Figures)))


@cache
def fixed_work_s() -> float:
    """Return the processor seconds of a fixed piece of work: the median of a few repeats.

    It is on one thread: arithmetic on arrays that leave the cache, sums of products, sorting, and plain Python. None of it asks
    for memory or has special instructions on some processors: how long these take says little of anything else.
    """
    import numpy as np

    values = np.random.default_rng(0).random(1_000_000, np.float32)
    found = np.empty_like(values)
    taken = []
    for _ in range(_REPEATS):
        started = time.thread_time()
        for _ in range(10):
            np.multiply(values, values, out=found)
            np.add(found, 1, out=found)
            np.sqrt(found, out=found)
        np.correlate(values, values[:40])
        np.sort(values[:200_000], kind="stable")
        sum(i * i for i in range(250_000))
        taken.append(time.thread_time() - started)
    return median(taken)
