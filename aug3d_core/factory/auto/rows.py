"""What a run needed and why, as `metrics.json`, the report and MLflow tell it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from aug3d_core.factory.auto.ground_kind import ground_of
from aug3d_core.factory.plan import Step
from aug3d_core.run.stage import Decision
from aug3d_core.sfm.files import POINTS
from aug3d_core.store.record import Record


def needs_of(
    made: Sequence[tuple[Step, Record, Path]], decisions: Mapping[str, tuple[Decision, ...]]
) -> list[dict[str, Any]]:
    """Return a row per decision in the order of the steps: `by` is auto, or the stage that decided by itself.

    made: each step with its record and the folder of its files. decisions: by step. What was set is no decision, but what a
    stage made of it may be.
    """
    rows: list[dict[str, Any]] = []
    for step, record, folder in made:
        told = {"step": step.name, "fold": step.fold}
        rows += [{**told, "by": "auto", **found.model_dump()} for found in decisions.get(step.name, ())]
        rows += [{**told, "by": step.stage.name, **found.model_dump()} for found in record.decisions]
        if step.stage.name == "sfm" and (folder / POINTS).is_file():  # what no record tells
            rows.append({**told, "by": "sfm", **ground_of(folder).model_dump()})
    return rows
