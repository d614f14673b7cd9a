"""Run a configuration as far as a figure needs. What trials have in common is made once."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from aug3d_core.errors import StageFailed, StoreError
from aug3d_core.folds import Step, seen_from, stage_of, steps
from aug3d_core.make import Material, gather, make
from aug3d_core.needs.decision import Decision
from aug3d_core.needs.settle import settle
from aug3d_core.scene_config import SceneConfig, scene_config
from aug3d_core.stage import Metric
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store

_GREW = ("photos_reused", "grown_from")  # figures of a run that cost less, for photographs had been added to its scene
Say = Callable[[str, int, int, str], None]  # stage, done, total, what
Damage = Callable[[str, Record], Record]  # what a stage made -> what the stages after it shall read


def undamaged(stage: str, record: Record) -> Record:
    """Hand on what a stage made as it is."""
    return record


@dataclass(frozen=True)
class Trial:
    """The records of the steps that ran, by name, and why it ended early if it did: in words, as StageFailed's cause, and at
    which stage.

    decisions: where the preset leaves settings open; those of the first fold. damaged: what stages made whole, where what
    `records` has in its place is damaged.
    """

    records: Mapping[str, Record]
    failure: str = ""
    cause: str = ""
    at: str = ""
    decisions: tuple[Decision, ...] = ()
    damaged: tuple[Record, ...] = ()

    def of(self, stages: Collection[str]) -> list[Record]:
        """Return the records of some stages, in every fold that was made."""
        return [record for step, record in self.records.items() if stage_of(step).name in stages]

    def seconds(self, stages: Collection[str]) -> float:
        """Return the wall time of some stages, whenever they ran."""
        return sum(record.seconds for record in self.of(stages))

    def cpu_seconds(self, stages: Collection[str]) -> float:
        """Return the processor time of some stages: what they cost whatever else the machine was doing."""
        return sum(record.cpu_seconds or 0.0 for record in self.of(stages))

    def peak_mib(self, stages: Collection[str]) -> float:
        """Return the highest memory of some stages."""
        return max((record.peak_mib for record in self.of(stages)), default=0.0)

    def metric(self, stage: str, name: str) -> Metric:
        """Return a figure of a stage, in the first fold; None if the stage did not finish."""
        return self.records[stage].metrics[name] if stage in self.records else None


@dataclass(frozen=True)
class Measured:
    """What is measured: a preset, and settings that differ from it in every trial."""

    preset: str
    overrides: tuple[str, ...] = ()

    def config(self, more: Iterable[str] = ()) -> SceneConfig:
        """Return the configuration of a trial; raises UsageError that names a wrong setting."""
        return scene_config(self.preset, (*self.overrides, *more))


def run_trial(
    store: Store,
    until: str,
    scene: Measured,
    overrides: Iterable[str],
    say: Say,
    photos: Path | None = None,
    damage: Damage = undamaged,
    afresh: bool = False,
    folds: bool = False,
) -> Trial:
    """Make every stage up to and with `until`, of the town or of a folder of photographs.

    A stage that fails ends the trial, not the benchmark: where a setting breaks is a result. afresh: no stage grows from
    what an earlier trial made, nor is anything taken that a run has grown, so that the order of trials is nothing to the
    result. folds: in every fold that the split finds, not in the first alone. Raises StoreError where every other trial
    would fail too.
    """
    config = scene.config(overrides)
    records: dict[str, Record] = {}
    decisions: tuple[Decision, ...] = ()
    damaged: tuple[Record, ...] = ()
    material = Material(photos=photos)
    stages = material.stages()
    stages = stages[: next((i for i, stage in enumerate(stages, 1) if stage.name == until), len(stages))]
    for step in steps(stages, records) if folds else map(Step, stages):
        stage, seen = step.stage, seen_from(step, stages, records)
        settled = settle(stage, config, seen, store, material)
        sources = gather(store, stage, seen, material)
        decisions += () if step.fold else settled.decisions
        try:
            own = step.in_fold(settled.config) if folds else settled.config
            told = partial(say, step.name)
            made = make(store, replace(stage, grows=stage.grows and not afresh), own, sources, told)
            if afresh and any(made.metrics.get(figure) for figure in _GREW):
                made = make(store, replace(stage, grows=False, afresh=True), own, sources, told)
            records[step.name] = damage(stage.name, made)
            damaged += () if records[step.name] is made else (made,)
        except StageFailed as failure:
            ends_all(failure)
            return Trial(records, failure.problem, failure.cause, failure.stage, decisions, damaged)
    return Trial(records, decisions=decisions, damaged=damaged)


def ends_all(failure: StageFailed) -> None:
    """Raise StoreError where every other trial would fail too, whatever its settings."""
    if failure.cause == "disk":
        raise StoreError(
            failure.problem, "free some space, then run the same command again: it goes on where it was"
        ) from failure
