"""MLflow: the study of stability is a run, and each of its cells a run nested in it."""

from __future__ import annotations

from pathlib import Path

from aug3d_core.stability.cell import Result
from aug3d_core.stability.findings import Findings
from aug3d_core.stability.write import NAME
from aug3d_core.store import layout
from aug3d_core.store.store import Store
from tasks.studies import Nested, digests, figures, log_nested

_LONGEST = 4000  # characters of a tag


def log_stability(store: Store, found: Findings, folder: Path) -> str:
    """Log the study with its map, page and data, and its cells; returns why MLflow could not be told, "" if it was."""
    counts = {
        "cells": len(found.results),
        "silent_failures": len(found.silent),
        "crashes": len(found.crashes),
        "false_alarms": len(found.false_alarms),
        "cpu_seconds": found.cpu_seconds,
    }
    study = Nested(f"study {folder.name}", {"study": NAME}, {"seeds": found.seeds, "size": found.size}, counts)
    names = (layout.STUDY_PAGE, layout.STUDY_CHART, layout.STUDY_FINDINGS, layout.STUDY_SCORES)
    return log_nested(store, NAME, study, [folder / name for name in names], [*map(_cell, found.results)])


def _cell(result: Result) -> Nested:
    cell = result.cell
    said = " | ".join((result.failure, *result.notes))[:_LONGEST]
    return Nested(
        cell.name,
        {"state": result.state, "said": said, **digests(result.records)},
        {"perturbation": cell.perturbation.name, "dose": cell.dose, "method": cell.method, "seed": cell.seed},
        {
            "accuracy": result.accuracy,
            "broken": int(result.broken),
            "silent": int(result.silent),
            **figures(result.records),
        },
        failed=result.state == "crash",
    )
