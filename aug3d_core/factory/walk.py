"""The stages in order: the one loop behind runs, dry runs, trials and studies.

For each step the settings that are left open are decided, the inputs gathered and the key computed, once. Who walks says
what happens with the work: build it, have a Prefect task build it, or only look whether it is in the store.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from aug3d_core.factory.auto.settle import settle
from aug3d_core.factory.build import Built, Work, work_of
from aug3d_core.factory.config import SceneConfig
from aug3d_core.factory.material import Material, gather, ready
from aug3d_core.factory.plan import Step, seen_from, steps
from aug3d_core.run.stage import Decision, Stage
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store


@dataclass(frozen=True)
class Visit:
    """A step of a walk. work: None while an input of it is missing. built: None if it was not built.

    decisions: about the settings that were left open.
    """

    step: Step
    work: Work | None = None
    built: Built | None = None
    decisions: tuple[Decision, ...] = ()

    @property
    def record(self) -> Record | None:
        """The step's object, None if there is none."""
        return self.built.record if self.built else None

    @property
    def cached(self) -> bool:
        """Whether the store had the object already."""
        return self.built is not None and self.built.cached


Make = Callable[[Visit], Built | None]  # a step with its work -> the object, None to leave it


def walk(
    store: Store,
    stages: Iterable[Stage],
    config: SceneConfig,
    material: Material,
    make: Make,
    given: Mapping[str, Record] | None = None,
    plan: Mapping[str, Visit] | None = None,
    before: Mapping[str, Record] | None = None,
    folds: bool = True,
) -> Iterator[Visit]:
    """Visit the steps of a run in order, each after what it reads; what `make` raises ends the walk.

    given: objects that are there already, by stage. plan: an earlier walk by step: its keys are not computed again unless an
    object is not what it found. before: what the scene's last version is made of, by step, whose work may be reused.
    folds: visit the later folds of a small scene too; otherwise the grouping's own fold alone.
    """
    records = dict(given or {})
    stages = tuple(stages)
    for step in steps(stages, records) if folds else map(Step, stages):
        visit = (plan or {}).get(step.name)
        if visit is None or visit.work is None:
            visit = _visit(store, step, config, {**(given or {}), **seen_from(step, stages, records)}, material, folds)
        if visit.work is not None and before:
            visit = replace(visit, work=replace(visit.work, before=before.get(step.name)))
        if visit.work is not None and (built := make(visit)):
            records[step.name] = built.record
            if visit.built and visit.built.record.digest != built.record.digest:
                plan = None  # it was damaged, and has other bytes now: later keys are others, too
            visit = Visit(step, visit.work, built, visit.decisions)
        yield visit


def planned(store: Store, material: Material, config: SceneConfig) -> Iterator[Visit]:
    """Visit every step of a run without building anything.

    A step with a missing input counts as to be built: whether that input will change is not known yet. Nor are folds before
    the split is made: there is one until then.
    """

    def look(visit: Visit) -> Built | None:
        assert visit.work
        record = store.find(visit.step.stage.name, visit.work.key)
        return Built(record, cached=True) if record else None

    return walk(store, material.stages(), config, material, look)


def _visit(
    store: Store, step: Step, config: SceneConfig, seen: Mapping[str, Record], material: Material, folds: bool
) -> Visit:
    if not ready(step.stage, seen, material):
        return Visit(step)
    settled = settle(step.stage, config, seen, store, material)
    chosen = step.in_fold(settled.config) if folds else settled.config
    return Visit(step, work_of(step.stage, chosen, gather(store, step.stage, seen, material)), None, settled.decisions)
