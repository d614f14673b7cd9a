"""Every cell of the study. What a killed study made is in the store, so the same call goes on where it was."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from aug3d_core.bench.trial import Say
from aug3d_core.stability.cell import Cell, Result, run_cell
from aug3d_core.store.store import Store

Done = Callable[[Result, int, int], None]  # a cell's result, how many are done, of how many


def run_cells(store: Store, cells: Sequence[Cell], say: Say, done: Done) -> list[Result]:
    """Make the cells one after the other; raises StoreError where the disk is full."""
    results: list[Result] = []
    for cell in cells:
        results.append(run_cell(store, cell, say))
        done(results[-1], len(results), len(cells))
    return results
