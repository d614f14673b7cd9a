"""The loop over cells: their order, and several processes or machines at one study."""

from __future__ import annotations

import threading
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import pytest

from aug3d_core.run.errors import StoreError
from aug3d_core.store import lease
from aug3d_core.store.store import Store
from aug3d_core.studies.common.cell import Cell, Result, make_cells
from aug3d_core.studies.common.trial import Trial


@dataclass(frozen=True)
class Number:
    number: int

    @property
    def name(self) -> str:
        return f"number {self.number}"


CELLS = [Cell(Number(number), 0) for number in range(12)]


def test_results_are_in_the_order_of_the_cells(tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    results = make_cells(
        Store(tmp_path), CELLS, lambda cell: Result(cell, Trial({})), lambda _, *count: told.append(count), before=3
    )
    assert [result.cell for result in results] == CELLS
    assert told == [(3 + number, 15) for number in range(1, 13)]


@pytest.mark.usefixtures("either")
def test_several_share_the_cells_and_each_ends_with_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A cell is made once, and costs nothing when it is there: so it is with its steps, in the store."""
    monkeypatch.setattr(lease, "LOOK_S", 0.05)
    there: set[str] = set()
    being_made = {cell.name: threading.Lock() for cell in CELLS}
    worked: Counter[int] = Counter()
    waited: list[str] = []

    def work(number: int) -> None:
        def make_cell(cell: Cell[Number]) -> Result[Number]:
            if being_made[cell.name].locked():
                waited.append(cell.name)
            with being_made[cell.name]:
                if cell.name not in there:
                    worked[number] += 1
                    time.sleep(0.2)
                    there.add(cell.name)
            return Result(cell, Trial({}))

        # Of one home where nothing is shared, else each on a machine of its own
        home = tmp_path / (str(number) if machines else "home")
        assert [result.cell for result in make_cells(Store(home), CELLS, make_cell, lambda *_: None)] == CELLS

    machines = Store(tmp_path / "look").shared is not None
    threads = [threading.Thread(target=work, args=(number,)) for number in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert there == {cell.name for cell in CELLS}
    assert len(waited) <= 4, "each waits for what the two others are at in the end, and never before"
    assert len(worked) == 3 and min(worked.values()) >= 2, "all had work"


def test_what_a_dead_machine_was_at_is_made_in_the_end(
    shared: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lease, "LOOK_S", 0.05)
    order: list[str] = []

    def make_cell(cell: Cell[Number]) -> Result[Number]:
        order.append(cell.name)
        return Result(cell, Trial({}))

    dead = Store(tmp_path / "dead").claim(CELLS[0].name)
    assert dead.__enter__()
    make_cells(Store(tmp_path / "alive"), CELLS, make_cell, lambda *_: None)
    assert order == [cell.name for cell in (*CELLS[1:], CELLS[0])]
    dead.__exit__(None, None, None)


def test_a_cell_that_cannot_be_made_lets_others_have_it(tmp_path: Path) -> None:
    def make_cell(cell: Cell[Number]) -> Result[Number]:
        raise StoreError("no room", "make some")

    store = Store(tmp_path)
    with pytest.raises(StoreError):
        make_cells(store, CELLS, make_cell, lambda *_: None)
    with store.claim(CELLS[0].name) as ours:
        assert ours
