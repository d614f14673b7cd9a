"""One run of the study: a perturbation at a dose, by a method, with a seed; its figure, and what the factory reported."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from aug3d_core.factory.build import Built
from aug3d_core.factory.material import source_of
from aug3d_core.factory.stages import FROM_PHOTOS, OVERLAP
from aug3d_core.factory.walk import Make, Visit
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from aug3d_core.studies.common.cell import Cell, Result
from aug3d_core.studies.common.trial import Measured, Trial, afresh, run_trial, single, tried
from aug3d_core.studies.stability.config import COMPUTED, DAMAGED, ComputedConfig, DamageConfig
from aug3d_core.studies.stability.perturbation import Computed, Damage, InFactory, Perturbation

CellState = Literal["ok", "degraded", "refused", "crash"]
_PRESET = "tiny"
# The stages that users have. In the town, overlaps are measured on the truth, which users do not have.
_FACTORY = frozenset(stage.name for stage in FROM_PHOTOS) - {OVERLAP.name} | {COMPUTED.name}


@dataclass(frozen=True)
class Dosed:
    """A perturbation at a dose, tried by a method."""

    perturbation: Perturbation
    dose: float
    method: str

    @property
    def name(self) -> str:
        """Its name in progress messages, tables and MLflow."""
        return f"{self.perturbation.name} {self.dose:g} {self.perturbation.dose_unit}, {self.method}"


@dataclass(frozen=True)
class StabilityResult(Result[Dosed]):
    """The result of a cell.

    accuracy: the judged figure, None where there is none. state: the worst that the factory's stages reported, from the
    damaged one on; crash: it ended in a way that no input should cause. said: what these stages reported.
    whole: records that were damaged.
    """

    accuracy: float | None
    state: CellState
    said: tuple[str, ...] = ()
    whole: tuple[Record, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """What the factory reported."""
        return self.said

    @property
    def used(self) -> list[Record]:
        """Everything that was made for the cell."""
        return [*self.records.values(), *self.whole]

    @property
    def broken(self) -> bool:
        """Whether the method is worse than its mark."""
        return self.arm.perturbation.judge.broken(self.accuracy)

    @property
    def silent(self) -> bool:
        """Whether it is broken and nothing was reported."""
        return self.broken and self.state == "ok" and self.arm.method not in self.arm.perturbation.compared


def make_cell(store: Store, cell: Cell[Dosed], make: Make) -> StabilityResult:
    """Make a cell; raises StoreError where every other cell would fail too."""
    perturbation, whole = cell.arm.perturbation, []
    judge, how = perturbation.judge, perturbation.how
    if isinstance(how, Computed):
        trial = _compute(cell, how, make)
    else:
        making = afresh(make)
        trial = _run(store, cell, how, _damaging(store, cell, how.damage, making, whole) if how.damage else making)
    judged = trial.records.get(judge.stage or COMPUTED.name)
    accuracy = None if judged is None else judge.figure(judged.metrics)
    state, said = _reported(trial, _disturbed(cell, list(trial.records)))
    return StabilityResult(cell, trial, accuracy, state, said, tuple(whole))


def _run(store: Store, cell: Cell[Dosed], how: InFactory, make: Make) -> Trial:
    overrides = how.overrides(cell.arm.dose, cell.arm.perturbation.methods[cell.arm.method], cell.seed)
    return run_trial(store, how.until, Measured(_PRESET, how.world), overrides, make)


def _damaging(
    store: Store, cell: Cell[Dosed], damage: Damage, make: Make, whole: list[Record]
) -> Callable[[Visit], Built | None]:
    """Return a maker that damages the output of a stage, and keeps the record of the whole one in `whole`.

    The metrics of the whole output stay, for stages that decide by them.
    """
    config = DamageConfig(damage=damage.function, dose=cell.arm.dose, seed=cell.seed)

    def make_damaged(visit: Visit) -> Built | None:
        built = make(visit)
        if built is None or visit.step.stage.name != damage.stage:
            return built
        whole.append(built.record)
        damaged = next(single(DAMAGED, config, {"whole": source_of(store, built.record)}, make)).record
        assert damaged
        return replace(built, record=damaged.model_copy(update={"metrics": built.record.metrics | damaged.metrics}))

    return make_damaged


def _compute(cell: Cell[Dosed], how: Computed, make: Make) -> Trial:
    config = ComputedConfig(compute=how.compute, dose=cell.arm.dose, method=cell.arm.method, seed=cell.seed)
    return tried(single(COMPUTED, config, {}, make))


def _disturbed(cell: Cell[Dosed], made: list[str]) -> list[str]:
    """Return the stages that work on what the dose changed: those after the damage, or from the first that a dose sets.

    What earlier stages report is the same at every dose.
    """
    how = cell.arm.perturbation.how
    if isinstance(how, Computed):
        return made
    if how.damage:
        return made[made.index(how.damage.stage) + 1 :] if how.damage.stage in made else made
    set_by_dose = {setting.partition(".")[0] for setting in how.settings(cell.arm.dose)}
    return made[min((made.index(stage) for stage in set_by_dose if stage in made), default=0) :]


def _reported(trial: Trial, disturbed: list[str]) -> tuple[CellState, tuple[str, ...]]:
    """Return the worst state of the disturbed stages, and their notes.

    A refusal by a stage that users do not have counts as a crash.
    """
    records = [trial.records[name] for name in disturbed if name in _FACTORY]
    notes = tuple(f"{record.stage}: {note}" for record in records for note in record.notes)
    if trial.failure:
        refused = trial.cause == "refused" and trial.at in _FACTORY
        return ("refused" if refused else "crash"), (*notes, trial.failure)
    return ("degraded" if any(record.state == "degraded" for record in records) else "ok"), notes
