"""Make a configuration as far as a figure needs. Trials share the objects that they have in common."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from aug3d_core.factory.build import Built, build, work_of
from aug3d_core.factory.config import SceneConfig, scene_config
from aug3d_core.factory.material import Material, Source
from aug3d_core.factory.plan import Step
from aug3d_core.factory.walk import Make, Visit, walk
from aug3d_core.run.errors import StageFailed, StoreError
from aug3d_core.run.stage import Decision, Metric, Stage, StageConfig
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store

Say = Callable[[str, int, int, str], None]  # stage, done, total, what


@dataclass(frozen=True)
class Trial:
    """The records of the steps that ran, by name. If a stage failed: the problem, its cause as in StageFailed, the stage.

    decisions: about settings that the preset leaves open, in the first fold.
    """

    records: Mapping[str, Record]
    failure: str = ""
    cause: str = ""
    at: str = ""
    decisions: tuple[Decision, ...] = ()

    def of(self, stages: Collection[str]) -> list[Record]:
        """Return the records of some stages, in every fold that was made."""
        return [record for record in self.records.values() if record.stage in stages]

    def seconds(self, stages: Collection[str]) -> float:
        """Return the wall time of some stages [s], whenever they ran."""
        return sum(record.seconds for record in self.of(stages))

    def cpu_seconds(self, stages: Collection[str]) -> float:
        """Return the processor time of some stages [s], whenever they ran."""
        return sum(record.cpu_seconds or 0.0 for record in self.of(stages))

    def peak_mib(self, stages: Collection[str]) -> float:
        """Return the highest memory of some stages [MiB]."""
        return max((record.peak_mib for record in self.of(stages)), default=0.0)

    def metric(self, stage: str, name: str) -> Metric:
        """Return a metric of a stage in the first fold; None if the stage did not finish."""
        return self.records[stage].metrics[name] if stage in self.records else None


@dataclass(frozen=True)
class Measured:
    """What is measured: a preset, and settings that differ from it in every trial."""

    preset: str
    overrides: tuple[str, ...] = ()

    def config(self, more: Iterable[str] = ()) -> SceneConfig:
        """Return the configuration of a trial; raises UsageError that names a wrong setting."""
        return scene_config(self.preset, (*self.overrides, *more))


def directly(store: Store, say: Say) -> Make:
    """Return a maker that builds each step in a process of its own, without Prefect."""

    def make(visit: Visit) -> Built:
        assert visit.work
        return build(store, visit.work, partial(say, visit.step.name))

    return make


def afresh(make: Make) -> Make:
    """Return a maker whose stages extend no earlier result, so that the order of trials does not matter.

    An object in the store that did extend one is built again.
    """

    def make_afresh(visit: Visit) -> Built | None:
        assert visit.work
        built = make(replace(visit, work=replace(visit.work, stage=replace(visit.work.stage, grows=False))))
        if built and built.record.grew:
            return make(replace(visit, work=visit.work.afresh()))
        return built

    return make_afresh


def run_trial(
    store: Store,
    until: str,
    scene: Measured,
    overrides: Iterable[str],
    make: Make,
    photos: Path | None = None,
    folds: bool = False,
) -> Trial:
    """Make every stage up to and with `until`, of the town or of a folder of photographs.

    folds: in every fold of the split, not only in the first.
    """
    material = Material(photos=photos)
    stages = material.stages()
    stages = stages[: next((i for i, stage in enumerate(stages, 1) if stage.name == until), len(stages))]
    return tried(walk(store, stages, scene.config(overrides), material, make, folds=folds))


def tried(visits: Iterable[Visit]) -> Trial:
    """Follow a walk to its end. A stage that fails ends the trial, but not the study: where a setting breaks is a result.

    Raises StoreError where every other trial would fail too.
    """
    records: dict[str, Record] = {}
    decisions: tuple[Decision, ...] = ()
    try:
        for visit in visits:
            assert visit.record
            records[visit.step.name] = visit.record
            decisions += () if visit.step.fold else visit.decisions
    except StageFailed as failure:
        if failure.cause == "disk":
            raise StoreError(failure.problem, "free some space, then run the same command again to resume") from failure
        return Trial(records, failure.problem, failure.cause, failure.stage, decisions)
    return Trial(records, decisions=decisions)


def single(stage: Stage, config: StageConfig, sources: Mapping[str, Source], make: Make) -> Iterator[Visit]:
    """Walk one stage that is not in the factory's lists."""
    visit = Visit(Step(stage), work_of(stage, config, sources))
    yield replace(visit, built=make(visit))
