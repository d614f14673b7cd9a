"""The cells of a study, their results, and the loop that makes them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Trial


@runtime_checkable
class Arm(Protocol):
    """What a study tries. Every study has arms of its own."""

    @property
    def name(self) -> str:
        """Its name in progress messages, tables and MLflow."""
        ...


ArmT = TypeVar("ArmT", bound=Arm)
ResultT = TypeVar("ResultT", bound="Result[Any]")
Done = Callable[[ResultT, int, int], None]  # a result, how many cells are done, of how many


@dataclass(frozen=True)
class Cell(Generic[ArmT]):
    """An arm with a seed, in a fold of the scene."""

    arm: ArmT
    seed: int
    fold: int = 0

    @property
    def name(self) -> str:
        """Its name in progress messages, tables and MLflow."""
        return f"{self.arm.name}, seed {self.seed}" + (f", fold {self.fold}" if self.fold else "")


@dataclass(frozen=True)
class Result(Generic[ArmT]):
    """The result of a cell. Studies add the figures that they judge."""

    cell: Cell[ArmT]
    trial: Trial

    @property
    def arm(self) -> ArmT:
        """The arm of the cell."""
        return self.cell.arm

    @property
    def seed(self) -> int:
        """The seed of the cell."""
        return self.cell.seed

    @property
    def failure(self) -> str:
        """Why the cell has no figure, "" if it has one."""
        return self.trial.failure

    @property
    def records(self) -> Mapping[str, Record]:
        """The records of the steps that ran, by name."""
        return self.trial.records

    @property
    def used(self) -> list[Record]:
        """Everything that was made for the cell."""
        return [*self.records.values()]

    @property
    def paid(self) -> list[Record]:
        """The records whose cost counts."""
        return self.used

    @property
    def seconds(self) -> float:
        """Wall time of the records that count [s]; other work on the machine lengthens it."""
        return sum(record.seconds for record in self.paid)

    @property
    def cpu_seconds(self) -> float:
        """Processor time of the records that count [s]."""
        return sum(record.cpu_seconds or 0.0 for record in self.paid)

    @property
    def notes(self) -> tuple[str, ...]:
        """The warnings of its steps."""
        degraded = ((step, record) for step, record in self.records.items() if record.state == "degraded")
        return tuple(f"{step}: {note}" for step, record in degraded for note in record.notes)

    def as_json(self) -> dict[str, Any]:
        """Return what every study tells programs about a cell."""
        return {
            "seed": self.seed,
            "failure": self.failure,
            "notes": list(self.notes),
            "seconds": self.seconds,
            "cpu_seconds": self.cpu_seconds,
            "objects": {step: record.key for step, record in self.records.items()},
        }


def make_cells(
    store: Store,
    cells: Iterable[Cell[ArmT]],
    make_cell: Callable[[Cell[ArmT]], ResultT],
    done: Done[ResultT],
    before: int = 0,
) -> list[ResultT]:
    """Make cells, and return their results in the same order. before: the number of cells that were done earlier.

    Steps of a killed study are in the store, so the same call resumes it. Processes, and machines that share the store, may
    make the same cells at once: what another is at comes later, when it is there. Raises StoreError where every other cell
    would fail too.
    """
    cells, results = list(cells), dict[int, ResultT]()
    left, put_off = deque(range(len(cells))), 0
    while left:
        place = left.popleft()
        with store.claim(cells[place].name) as ours:
            if not ours and put_off < len(left):
                left.append(place)
                put_off += 1
                continue
            results[place] = make_cell(cells[place])
        put_off = 0
        done(results[place], before + len(results), before + len(cells))
    return [results[place] for place in range(len(cells))]
