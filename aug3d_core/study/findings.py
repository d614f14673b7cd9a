"""All that a study found, as data: what the table, the chart, the page and programs read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import pandas as pd

from aug3d_core.store.usage import named
from aug3d_core.study.arm import Study
from aug3d_core.study.cell import Result
from aug3d_core.study.scene import FinishedScene
from aug3d_core.study.scores import score_table
from aug3d_core.study.statistics import Difference, Tested, test_orderings
from aug3d_core.study.table import Row, cheap_answers, rows


@dataclass(frozen=True)
class Findings:
    """A study, done. effort: what each run was trained with, the same in every arm. cheap: by number of input views."""

    study: Study
    scene: str
    preset: str
    machine: str
    seeds: int
    effort: Mapping[str, int | float | str]
    test_photos: int
    rows: Sequence[Row]
    tested: Sequence[Tested]
    cheap: Mapping[int, Mapping[str, float]]
    scores: pd.DataFrame
    results: Sequence[Result]

    @property
    def failed(self) -> int:
        """The number of runs without a score, or whose network learned nothing."""
        return sum(result.failed for result in self.results)


def findings(study: Study, scene: FinishedScene, seeds: int, results: Sequence[Result], machine: str) -> Findings:
    """Judge the results of a study."""
    scores = score_table(results)
    return Findings(
        study=study,
        scene=scene.name,
        preset=scene.preset,
        machine=machine,
        seeds=seeds,
        effort=effort(scene),
        test_photos=len(scores[["fold", "photo_id"]].drop_duplicates()),
        rows=rows(results, scores),
        tested=test_orderings(scores, study.orderings),
        cheap=cheap_answers(scores),
        scores=scores,
        results=results,
    )


def effort(scene: FinishedScene) -> dict[str, int | float | str]:
    """Return what is the same in every run."""
    training, dataset = scene.settings.training, scene.settings.dataset
    return {
        "steps": training.steps,
        "rays a step": training.groups_per_step * training.rays_per_group,
        "hidden units": training.hidden,
        "encoder": training.encoder,
        "picture": f"{dataset.width_px} x {dataset.height_px} px",
    }


def as_json(found: Findings) -> dict[str, Any]:
    """Return the findings for programs."""
    return {
        "name": found.study.name,
        "scene": found.scene,
        "preset": found.preset,
        "machine": found.machine,
        "seeds": found.seeds,
        "effort": dict(found.effort),
        "test_photos": found.test_photos,
        "failed_runs": found.failed,
        "arms": [_row(row) for row in found.rows],
        "orderings": [_tested(tested) for tested in found.tested],
        "cheap": {str(inputs): dict(answers) for inputs, answers in found.cheap.items()},
        "cells": [_cell(result) for result in found.results],
        "objects": named(record for result in found.results for record in result.records.values()),
    }


def _row(row: Row) -> dict[str, Any]:
    told = {name: value for name, value in vars(row).items() if name not in ("arm", "against")}
    against = None if row.against is None else _difference(row.against)
    return {"arm": row.arm.key, **asdict(row.arm), **told, "against": against}


def _tested(tested: Tested) -> dict[str, Any]:
    pairs = [_difference(difference) for difference in tested.differences]
    return {
        "claim": tested.ordering.claim,
        "paper": tested.ordering.paper,
        "verdict": tested.verdict,
        "pairs": pairs,
    }


def _difference(difference: Difference) -> dict[str, Any]:
    return {**asdict(difference), "verdict": difference.verdict}


def _cell(result: Result) -> dict[str, Any]:
    cell = result.cell
    return {
        "arm": cell.arm.key,
        "seed": cell.seed,
        "fold": cell.fold,
        "failure": result.failure,
        "notes": list(result.notes),
        "psnr": result.mean("psnr"),
        "ssim": result.mean("ssim"),
        "seconds": result.seconds,
        "cpu_seconds": result.cpu_seconds,
        "objects": {stage: record.key for stage, record in result.records.items()},
    }
