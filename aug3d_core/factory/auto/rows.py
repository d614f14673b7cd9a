"""What a run needed and why, as `metrics.json`, the report and MLflow tell it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from aug3d_core.factory.auto.distinct import photos_worth
from aug3d_core.factory.auto.ground_kind import ground_of
from aug3d_core.factory.plan import Step
from aug3d_core.run.stage import Decision
from aug3d_core.sfm.files import POINTS, TRACKS
from aug3d_core.store.record import Record
from aug3d_core.training.config import TrainingConfig

_INPUTS = TrainingConfig().input_views  # of a run that ends before training


def needs_of(
    made: Sequence[tuple[Step, Record, Path]], decisions: Mapping[str, tuple[Decision, ...]]
) -> list[dict[str, Any]]:
    """Return a row per decision in the order of the steps: `by` is auto, or the stage that decided by itself.

    made: each step with its record and the folder of its files. decisions: by step. What was set is no decision, but what a
    stage made of it may be.
    """
    rows: list[dict[str, Any]] = []
    sfm = next((folder for step, _, folder in made if step.stage.name == "sfm"), None)
    given = next((int(record.config.get("input_views", 0)) for _, record, _ in made if record.stage == "training"), 0)
    for step, record, folder in made:
        told = {"step": step.name, "fold": step.fold}
        rows += [{**told, "by": "auto", **found.model_dump()} for found in decisions.get(step.name, ())]
        rows += [{**told, "by": step.stage.name, **found.model_dump()} for found in record.decisions]
        rows += [
            {**told, "by": step.stage.name, **found.model_dump()}
            for found in _measured(step, folder, sfm, given or _INPUTS)
        ]
    return rows


def _measured(step: Step, folder: Path, sfm: Path | None, inputs: int) -> Iterator[Decision]:
    """Yield what no record tells, from the files of a step that has them."""
    if step.stage.name == "sfm" and (folder / POINTS).is_file():
        yield ground_of(folder)
    if step.stage.name == "grouping" and sfm and (sfm / TRACKS).is_file():
        yield photos_worth(sfm, folder, inputs)
