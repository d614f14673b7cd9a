"""All that the study found, as data: what the map, the page, the terminal and programs read."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from aug3d_core.stability.cell import CellState, Result
from aug3d_core.stability.perturbation import Perturbation
from aug3d_core.store.usage import named

_WORST: tuple[CellState, ...] = ("crash", "refused", "degraded", "ok")


@dataclass(frozen=True)
class Dose:
    """A method at one dose, over all seeds.

    accuracy: the median over the seeds, None where it is one without a figure: none is worse than any. broken: half of the
    seeds are, or more. state: the state of most seeds, the worse one where two are as many.
    """

    dose: float
    results: Sequence[Result]

    @property
    def accuracy(self) -> float | None:
        """The median accuracy."""
        judge = self.results[0].cell.perturbation.judge
        worst = -math.inf if judge.better == "higher" else math.inf
        told = (result.accuracy for result in self.results)
        middle = float(np.median([worst if figure is None or math.isnan(figure) else figure for figure in told]))
        return None if math.isinf(middle) else middle

    @property
    def broken(self) -> bool:
        """Whether the method is broken at this dose."""
        return 2 * sum(result.broken for result in self.results) >= len(self.results)

    @property
    def state(self) -> CellState:
        """What the factory reports at this dose."""
        states = [result.state for result in self.results]
        return max(_WORST, key=states.count)

    @property
    def silent(self) -> int:
        """The number of seeds that are broken without a word."""
        return sum(result.silent for result in self.results)


@dataclass(frozen=True)
class Row:
    """A method under a perturbation, from harmless to ruinous."""

    perturbation: Perturbation
    method: str
    doses: Sequence[Dose]

    @property
    def breaking(self) -> Dose | None:
        """The first dose at which the method is broken; None if it never is."""
        return next((dose for dose in self.doses if dose.broken), None)

    @property
    def noticed(self) -> Dose | None:
        """The first dose at which the factory reports something; None if it never does."""
        return next((dose for dose in self.doses if dose.state != "ok"), None)


@dataclass(frozen=True)
class Findings:
    """The study, done. size: quick, full or chosen."""

    size: str
    machine: str
    seeds: int
    rows: Sequence[Row]
    results: Sequence[Result]

    @property
    def silent(self) -> list[Result]:
        """The cells that are broken while the factory says that all is well."""
        return [result for result in self.results if result.silent]

    @property
    def crashes(self) -> list[Result]:
        """The cells that ended as no input should make a stage end."""
        return [result for result in self.results if result.state == "crash"]

    @property
    def false_alarms(self) -> list[Result]:
        """The cells at the harmless dose of which the factory reports something though they are not broken."""
        return [r for r in self.results if _harmless(r) and not r.broken and r.state != "ok"]

    @property
    def seconds(self) -> float:
        """Wall time of everything that the cells are made of, each object counted once."""
        return sum(record.seconds for record in self._objects())

    @property
    def cpu_seconds(self) -> float:
        """Processor time of the same."""
        return sum(record.cpu_seconds or 0.0 for record in self._objects())

    def _objects(self) -> Iterable[Any]:
        return {record.key: record for result in self.results for record in result.made}.values()


def findings(size: str, seeds: int, machine: str, results: Sequence[Result]) -> Findings:
    """Gather the results by perturbation and method, in the order in which they were made."""
    by_row: dict[tuple[str, str], dict[float, list[Result]]] = {}
    for result in results:
        cell = result.cell
        by_row.setdefault((cell.perturbation.name, cell.method), {}).setdefault(cell.dose, []).append(result)
    rows = [_row(method, doses) for (_, method), doses in by_row.items()]
    return Findings(size, machine, seeds, rows, results)


def _row(method: str, doses: dict[float, list[Result]]) -> Row:
    perturbation = next(iter(doses.values()))[0].cell.perturbation
    return Row(perturbation, method, [Dose(d, doses[d]) for d in perturbation.doses if d in doses])


def _harmless(result: Result) -> bool:
    return result.cell.dose == result.cell.perturbation.doses[0]


def as_json(found: Findings) -> dict[str, Any]:
    """Return the findings for programs."""
    return {
        "name": "stability",
        "size": found.size,
        "machine": found.machine,
        "seeds": found.seeds,
        "cells": len(found.results),
        "silent_failures": len(found.silent),
        "crashes": len(found.crashes),
        "false_alarms": len(found.false_alarms),
        "seconds": found.seconds,
        "cpu_seconds": found.cpu_seconds,
        "breaking_doses": [_breaking(row) for row in found.rows],
        "results": cell_table(found).to_dict("records"),
        "objects": named(record for result in found.results for record in result.made),
    }


def _breaking(row: Row) -> dict[str, Any]:
    judge, breaking, noticed = row.perturbation.judge, row.breaking, row.noticed
    return {
        "perturbation": row.perturbation.name,
        "method": row.method,
        "dose_unit": row.perturbation.dose_unit,
        "figure": judge.name,
        "better": judge.better,
        "mark": judge.mark,
        "breaking_dose": breaking and breaking.dose,
        "state_there": breaking and breaking.state,
        "noticed_from": noticed and noticed.dose,
        "harmless_accuracy": row.doses[0].accuracy,
    }


def cell_table(found: Findings) -> pd.DataFrame:
    """Return a row per cell; what is missing is None."""
    rows = [
        {
            "perturbation": result.cell.perturbation.name,
            "part": result.cell.perturbation.part,
            "method": result.cell.method,
            "dose": float(result.cell.dose),
            "dose_unit": result.cell.perturbation.dose_unit,
            "seed": result.cell.seed,
            "figure": result.cell.perturbation.judge.name,
            "accuracy": result.accuracy,
            "broken": result.broken,
            "state": result.state,
            "silent": result.silent,
            "seconds": result.seconds,
            "cpu_seconds": result.cpu_seconds,
            "notes": " | ".join(result.notes),
            "objects": " ".join(f"{stage}:{record.key}" for stage, record in result.records.items()),
        }
        for result in found.results
    ]
    table = pd.DataFrame(rows)
    return table.astype(object).where(table.notna(), None)
