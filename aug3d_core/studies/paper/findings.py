"""The findings of a table as data, for the chart, the page and programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import pandas as pd

from aug3d_core.store.usage import named
from aug3d_core.studies.paper.arm import PaperTable
from aug3d_core.studies.paper.cell import PaperResult
from aug3d_core.studies.paper.orderings import Difference, JudgedOrdering, judge_orderings
from aug3d_core.studies.paper.rows import ArmRow, cheap_answers, rows
from aug3d_core.studies.paper.scene import FinishedScene
from aug3d_core.studies.paper.scores import score_table


@dataclass(frozen=True)
class PaperFindings:
    """A table, made and judged. effort: how each run was trained, the same in every arm. cheap: by number of input views."""

    table: PaperTable
    scene: str
    preset: str
    machine: str
    seeds: int
    effort: Mapping[str, int | float | str]
    test_photos: int
    rows: Sequence[ArmRow]
    orderings: Sequence[JudgedOrdering]
    cheap: Mapping[int, Mapping[str, float]]
    scores: pd.DataFrame
    results: Sequence[PaperResult]

    @property
    def failed(self) -> int:
        """The number of runs without a score, or whose network learned nothing."""
        return sum(result.failed for result in self.results)

    @property
    def parts(self) -> Mapping[str, Sequence[ArmRow]]:
        """The rows of each part of the table."""
        names = dict.fromkeys(row.arm.part for row in self.rows)
        return {part: [row for row in self.rows if row.arm.part == part] for part in names}


def findings(
    table: PaperTable, scene: FinishedScene, seeds: int, results: Sequence[PaperResult], machine: str
) -> PaperFindings:
    """Judge the results of a table."""
    scores = score_table(results)
    return PaperFindings(
        table=table,
        scene=scene.name,
        preset=scene.preset,
        machine=machine,
        seeds=seeds,
        effort=effort(scene),
        test_photos=len(scores[["fold", "photo_id"]].drop_duplicates()),
        rows=rows(results, scores),
        orderings=judge_orderings(scores, table.orderings),
        cheap=cheap_answers(scores),
        scores=scores,
        results=results,
    )


def effort(scene: FinishedScene) -> dict[str, int | float | str]:
    """Return what is the same in every run."""
    training, dataset = scene.settings.training, scene.settings.dataset
    return {
        "steps": training.steps,
        "head": training.head.title,
        "groups a step": training.groups_per_step,
        **training.head.facts,
        "picture": f"{dataset.width_px} x {dataset.height_px} px",
    }


def as_json(found: PaperFindings) -> dict[str, Any]:
    """Return the findings for programs."""
    return {
        "name": found.table.name,
        "scene": found.scene,
        "preset": found.preset,
        "machine": found.machine,
        "seeds": found.seeds,
        "effort": dict(found.effort),
        "test_photos": found.test_photos,
        "failed_runs": found.failed,
        "arms": [_row(row) for row in found.rows],
        "orderings": [_ordering(judged) for judged in found.orderings],
        "cheap": {str(inputs): dict(answers) for inputs, answers in found.cheap.items()},
        "cells": [result.as_json() for result in found.results],
        "objects": named(record for result in found.results for record in result.used),
    }


def _row(row: ArmRow) -> dict[str, Any]:
    figures = {name: value for name, value in vars(row).items() if name not in ("arm", "against")}
    arm = {name if name != "name" else "key": value for name, value in asdict(row.arm).items()}
    against = None if row.against is None else _difference(row.against)
    return {"arm": row.arm.name, **arm, **figures, "against": against}


def _ordering(judged: JudgedOrdering) -> dict[str, Any]:
    return {
        "claim": judged.ordering.claim,
        "paper": judged.ordering.paper,
        "verdict": judged.verdict,
        "pairs": [_difference(difference) for difference in judged.differences],
    }


def _difference(difference: Difference) -> dict[str, Any]:
    return {**asdict(difference), "verdict": difference.verdict}
