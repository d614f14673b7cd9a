"""The steps of a run: each is a stage in a fold.

A scene with few photographs is made in folds: the stages from the split on run once per fold, each time with another block
of ground as the test. The split decides how many folds there are. Steps of the first fold have the names of their stages.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from aug3d_core.factory.stages import GROUPING, STAGES
from aug3d_core.run.stage import Stage, StageConfig
from aug3d_core.store.record import Record

_FOLD = "_fold"


@dataclass(frozen=True)
class Step:
    """A stage in a fold; folds count from 0."""

    stage: Stage
    fold: int = 0

    @property
    def name(self) -> str:
        """The name in `metrics.json`, the report and MLflow: the stage's own in the first fold."""
        return _name(self.stage.name, self.fold)

    def in_fold(self, chosen: StageConfig) -> StageConfig:
        """Return the stage's settings as they are in this fold."""
        return chosen.model_copy(update={"fold": self.fold}) if self.stage.name == GROUPING.name else chosen


def steps(stages: Iterable[Stage], records: Mapping[str, Record]) -> Iterator[Step]:
    """Yield the steps of a run in order. records: the objects so far, by step; read again while the run proceeds."""
    stages = tuple(stages)
    yield from map(Step, stages)
    yield from later_folds(stages, records)


def later_folds(stages: Iterable[Stage], records: Mapping[str, Record]) -> tuple[Step, ...]:
    """Return the steps of all folds but the first; none before the split is made."""
    return later_folds_of(stages, fold_count(records))


def later_folds_of(stages: Iterable[Stage], folds: int) -> tuple[Step, ...]:
    """Return the steps of all folds but the first, of so many."""
    made_in_each = _of_the_split(stages)
    return tuple(Step(stage, fold) for fold in range(1, folds) for stage in made_in_each)


def fold_count(records: Mapping[str, Record]) -> int:
    """Return the number of folds of the split, 1 before it is made."""
    return int(records[GROUPING.name].metrics.get("folds") or 1) if GROUPING.name in records else 1


def seen_from(step: Step, stages: Iterable[Stage], records: Mapping[str, Record]) -> dict[str, Record]:
    """Return the objects that a step can read, by stage: from the split on, those of its own fold."""
    split = {stage.name for stage in _of_the_split(stages)}
    names = {stage.name: _name(stage.name, step.fold if stage.name in split else 0) for stage in stages}
    return {stage: records[name] for stage, name in names.items() if name in records}


def stage_of(step: str) -> Stage:
    """Return the stage of a step by the step's name."""
    return STAGES[stage_and_fold(step)[0]]


def stage_and_fold(step: str) -> tuple[str, int]:
    """Take the name of a step apart: the name of its stage, which may be one of another version, and its fold."""
    stage, _, fold = step.partition(_FOLD)
    return stage, int(fold or 0)


def _of_the_split(stages: Iterable[Stage]) -> list[Stage]:
    """Return the split and every stage that reads it, at any remove."""
    found: list[Stage] = []
    for stage in stages:
        if stage.name == GROUPING.name or {s.name for s in found} & set(stage.inputs):
            found.append(stage)
    return found


def _name(stage: str, fold: int) -> str:
    return f"{stage}{_FOLD}{fold}" if fold else stage
