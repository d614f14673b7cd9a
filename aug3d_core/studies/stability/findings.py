"""The findings of the study as data, for the map, the page, the terminal and programs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from aug3d_core.store.usage import named
from aug3d_core.studies.stability.cell import CellState, StabilityResult
from aug3d_core.studies.stability.perturbation import Perturbation

_WORST: tuple[CellState, ...] = ("crash", "refused", "degraded", "ok")


@dataclass(frozen=True)
class Dose:
    """A method at one dose, over all seeds.

    accuracy: the median over the seeds, where no figure is worse than any; None if the median has no figure.
    broken: half of the seeds or more are. state: the most frequent state of the seeds, the worse one of two.
    """

    dose: float
    results: Sequence[StabilityResult]

    @property
    def accuracy(self) -> float | None:
        """The median accuracy."""
        judge = self.results[0].arm.perturbation.judge
        worst = -math.inf if judge.better == "higher" else math.inf
        figures = (result.accuracy for result in self.results)
        middle = float(np.median([worst if figure is None or math.isnan(figure) else figure for figure in figures]))
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
        """The number of seeds that are broken and unnoticed."""
        return sum(result.silent for result in self.results)


@dataclass(frozen=True)
class MethodRow:
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
class StabilityFindings:
    """The study, made and judged. size: quick, full or chosen."""

    size: str
    machine: str
    seeds: int
    rows: Sequence[MethodRow]
    results: Sequence[StabilityResult]

    @property
    def silent(self) -> list[StabilityResult]:
        """The cells that are broken while the factory reports ok."""
        return [result for result in self.results if result.silent]

    @property
    def crashes(self) -> list[StabilityResult]:
        """The cells that ended in a way that no input should cause."""
        return [result for result in self.results if result.state == "crash"]

    @property
    def false_alarms(self) -> list[StabilityResult]:
        """The cells at the harmless dose that are not broken, but of which the factory reports something."""
        return [r for r in self.results if _harmless(r) and not r.broken and r.state != "ok"]

    @property
    def seconds(self) -> float:
        """Wall time of everything that was made for the cells [s], each object counted once."""
        return sum(record.seconds for record in self._objects())

    @property
    def cpu_seconds(self) -> float:
        """Processor time of the same [s]."""
        return sum(record.cpu_seconds or 0.0 for record in self._objects())

    def _objects(self) -> Iterable[Any]:
        return {record.key: record for result in self.results for record in result.used}.values()


def findings(size: str, seeds: int, machine: str, results: Sequence[StabilityResult]) -> StabilityFindings:
    """Gather the results by perturbation and method, in the order in which they were made."""
    by_row: dict[tuple[str, str], dict[float, list[StabilityResult]]] = {}
    for result in results:
        arm = result.arm
        by_row.setdefault((arm.perturbation.name, arm.method), {}).setdefault(arm.dose, []).append(result)
    rows = [_row(method, doses) for (_, method), doses in by_row.items()]
    return StabilityFindings(size, machine, seeds, rows, results)


def _row(method: str, doses: dict[float, list[StabilityResult]]) -> MethodRow:
    perturbation = next(iter(doses.values()))[0].arm.perturbation
    return MethodRow(perturbation, method, [Dose(d, doses[d]) for d in perturbation.doses if d in doses])


def _harmless(result: StabilityResult) -> bool:
    return result.arm.dose == result.arm.perturbation.doses[0]


def as_json(found: StabilityFindings) -> dict[str, Any]:
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
        "objects": named(record for result in found.results for record in result.used),
    }


def _breaking(row: MethodRow) -> dict[str, Any]:
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


def cell_table(found: StabilityFindings) -> pd.DataFrame:
    """Return a row per cell; what is missing is None."""
    rows = [
        {
            "perturbation": result.arm.perturbation.name,
            "part": result.arm.perturbation.part,
            "method": result.arm.method,
            "dose": float(result.arm.dose),
            "dose_unit": result.arm.perturbation.dose_unit,
            "seed": result.seed,
            "figure": result.arm.perturbation.judge.name,
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
