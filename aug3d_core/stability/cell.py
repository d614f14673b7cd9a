"""One run of the study: a perturbation at a dose, a method and a seed; what came out, and what the factory said of it.

Every step is an object of the store: cells share what they have in common, and what a killed study made is found again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from aug3d_core.bench.trial import Measured, Say, Trial, ends_all, run_trial
from aug3d_core.errors import StageFailed
from aug3d_core.make import make, source_of
from aug3d_core.stability.config import ComputedConfig, SpoilConfig
from aug3d_core.stability.perturbation import Computed, InFactory, Perturbation, Spoil
from aug3d_core.stages import COMPUTED, FROM_PHOTOS, OVERLAP, SPOILED
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store

CellState = Literal["ok", "degraded", "refused", "crash"]
_PRESET = "tiny"
# What users have; in the town, overlaps are measured on the truth, which users do not have.
_FACTORY = frozenset(stage.name for stage in FROM_PHOTOS) - {OVERLAP.name} | {COMPUTED.name}


@dataclass(frozen=True)
class Cell:
    """A perturbation at a dose, tried by a method, with a seed."""

    perturbation: Perturbation
    dose: float
    method: str
    seed: int

    @property
    def name(self) -> str:
        """How progress, tables and MLflow call it."""
        return f"{self.perturbation.name} {self.dose:g} {self.perturbation.dose_unit}, {self.method}, seed {self.seed}"


@dataclass(frozen=True)
class Result:
    """What became of a cell.

    accuracy: the judged figure, None where there is none. state: the worst that the factory's stages reported, from the
    damaged one on; crash: it ended in a way that no input should bring about. notes: what the stages said.
    """

    cell: Cell
    records: Mapping[str, Record]
    accuracy: float | None
    state: CellState
    notes: tuple[str, ...] = ()
    failure: str = ""
    damaged: tuple[Record, ...] = ()  # what was whole before the dose

    @property
    def made(self) -> list[Record]:
        """All that was made for it."""
        return [*self.records.values(), *self.damaged]

    @property
    def broken(self) -> bool:
        """Whether the method did worse than the mark that was set beforehand."""
        return self.cell.perturbation.judge.broken(self.accuracy)

    @property
    def silent(self) -> bool:
        """Whether it is broken and nobody would know."""
        return self.broken and self.state == "ok" and self.cell.method not in self.cell.perturbation.compared

    @property
    def seconds(self) -> float:
        """Wall time of its stages, whenever they ran."""
        return sum(record.seconds for record in self.made)

    @property
    def cpu_seconds(self) -> float:
        """Processor time of its stages, whatever else the machine was doing."""
        return sum(record.cpu_seconds or 0.0 for record in self.made)


def run_cell(store: Store, cell: Cell, say: Say) -> Result:
    """Make a cell, or find it made; raises StoreError where every other cell would fail too."""
    how = cell.perturbation.how
    trial = _compute(store, cell, how, say) if isinstance(how, Computed) else _run(store, cell, how, say)
    judge = cell.perturbation.judge
    told = trial.records.get(judge.stage or COMPUTED.name)
    accuracy = None if told is None else judge.figure(told.metrics)
    state, notes = _reported(trial, _disturbed(cell, list(trial.records)))
    return Result(cell, trial.records, accuracy, state, notes, trial.failure, trial.damaged)


def _run(store: Store, cell: Cell, how: InFactory, say: Say) -> Trial:
    seeds = (f"{field}={cell.seed}" for field in how.seeded)
    overrides = (*seeds, *how.settings(cell.dose), *cell.perturbation.methods[cell.method])

    def damage(stage: str, record: Record) -> Record:
        if how.spoil is None or stage != how.spoil.stage:
            return record
        return _spoiled(store, record, how.spoil, cell, say)

    measured = Measured(_PRESET, how.world)
    return run_trial(store, how.until, measured, overrides, say, damage=damage, afresh=True)


def _spoiled(store: Store, record: Record, spoil: Spoil, cell: Cell, say: Say) -> Record:
    """Return what a stage made, damaged. Its figures stay, for stages that decide by them.

    The key follows the code of the damage, not of all damages.
    """
    config = SpoilConfig(damage=spoil.damage, dose=cell.dose, seed=cell.seed)
    stage = replace(SPOILED, entry=spoil.damage)
    made = make(store, stage, config, {"whole": source_of(store, record)}, lambda *told: say(stage.name, *told))
    return made.model_copy(update={"metrics": record.metrics | made.metrics})


def _compute(store: Store, cell: Cell, how: Computed, say: Say) -> Trial:
    config = ComputedConfig(compute=how.compute, dose=cell.dose, method=cell.method, seed=cell.seed)
    stage = replace(COMPUTED, entry=how.compute)
    try:
        made = make(store, stage, config, {}, lambda *told: say(stage.name, *told))
    except StageFailed as failure:
        ends_all(failure)
        return Trial({}, failure.problem, failure.cause, failure.stage)
    return Trial({COMPUTED.name: made})


def _disturbed(cell: Cell, made: list[str]) -> list[str]:
    """Return the stages that work on what the dose changed: those after a damage, or from the first that a dose sets.

    What the ones before say holds for every dose, the harmless one too.
    """
    how = cell.perturbation.how
    if isinstance(how, Computed):
        return made
    if how.spoil:
        return made[made.index(how.spoil.stage) + 1 :] if how.spoil.stage in made else made
    set_by_dose = {setting.partition(".")[0] for setting in how.settings(cell.dose)}
    return made[min((made.index(stage) for stage in set_by_dose if stage in made), default=0) :]


def _reported(trial: Trial, disturbed: list[str]) -> tuple[CellState, tuple[str, ...]]:
    """Return the worst state that the factory reported of disturbed stages, and what it said.

    A stage that users do not have cannot refuse anything for them.
    """
    records = [trial.records[name] for name in disturbed if name in _FACTORY]
    notes = tuple(f"{record.stage}: {note}" for record in records for note in record.notes)
    if trial.failure:
        refused = trial.cause == "refused" and trial.at in _FACTORY
        return ("refused" if refused else "crash"), (*notes, trial.failure)
    return ("degraded" if any(record.state == "degraded" for record in records) else "ok"), notes
