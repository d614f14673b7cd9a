"""One run of an arm: groups, virtual views if it has any, data set, model, test."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

from aug3d_core.dataset.declared import DATASET_OF_PHOTOS
from aug3d_core.factory.material import Material
from aug3d_core.factory.stages import DATASET, EVALUATION, GROUPING, RENDERING, SAMPLING, TRAINING
from aug3d_core.factory.walk import Make, Visit, walk
from aug3d_core.judging.files import TEST_VIEWS
from aug3d_core.run.errors import StageFailed, UsageError
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from aug3d_core.studies.common.cell import Cell, Result
from aug3d_core.studies.common.trial import tried
from aug3d_core.studies.paper.arm import PaperArm
from aug3d_core.studies.paper.scene import FinishedScene, read_split

_MODEL = (TRAINING, EVALUATION)


@dataclass(frozen=True)
class PaperResult(Result[PaperArm]):
    """The result of a run. views: its rows of the test's table; empty if there is a failure."""

    views: pd.DataFrame = field(default_factory=pd.DataFrame)

    @property
    def notes(self) -> tuple[str, ...]:
        """The warnings of its steps, and of training every note: a restart leaves its state "ok"."""
        noted = (r for r in self.records.values() if r.state == "degraded" or r.stage == TRAINING.name)
        return tuple(f"{record.stage}: {note}" for record in noted for note in record.notes)

    @property
    def failed(self) -> bool:
        """Whether it has no score, or the score of a network that learned nothing."""
        return bool(self.failure) or self.records[TRAINING.name].state == "degraded"

    @property
    def paid(self) -> list[Record]:
        """The records of training and test."""
        return self.trial.of([stage.name for stage in _MODEL])

    def metric(self, stage: str, name: str) -> float | None:
        """Return a metric of a step as a number, None if there is none."""
        value = self.records[stage].metrics.get(name) if stage in self.records else None
        return float(value) if isinstance(value, int | float) else None

    def mean(self, score: str) -> float | None:
        """Return the mean of a score over the test photographs, None where there is none."""
        return None if self.failure else float(np.mean(np.asarray(self.views[score], float)))

    def as_json(self) -> dict[str, Any]:
        """Return the result for programs."""
        scores = {"psnr": self.mean("psnr"), "ssim": self.mean("ssim")}
        return {"arm": self.arm.name, "fold": self.cell.fold, **scores, **super().as_json()}


def make_cell(store: Store, scene: FinishedScene, cell: Cell[PaperArm], make: Make) -> PaperResult:
    """Make a cell. A step that fails ends the cell, not the study.

    Raises UsageError where the settings change the scene's test, StoreError where every other cell would fail too.
    """
    trial = tried(_steps(store, scene, cell, make))
    if trial.failure:
        return PaperResult(cell, trial)
    views = pd.read_parquet(store.file(trial.records[EVALUATION.name], TEST_VIEWS))
    lost = int((~np.isfinite(views["psnr"])).sum())
    if lost:
        return PaperResult(cell, replace(trial, failure=f"the test has no PSNR for {lost} photos"))
    return PaperResult(cell, trial, views)


def _steps(store: Store, scene: FinishedScene, cell: Cell[PaperArm], make: Make) -> Iterator[Visit]:
    """Make the steps in order; raises StageFailed where the cell cannot be what its arm says."""
    given, share = scene.given(cell.fold), cell.arm.rendered_share
    changes = (*cell.arm.settings, f"grouping.fold={cell.fold}", f"training.seed={cell.seed}")
    config = scene.config(changes)
    [grouped] = walk(store, (GROUPING,), config, Material(), make, given, folds=False)
    assert grouped.record
    yield grouped
    _check_split(store, scene, cell, grouped.record)
    metrics = grouped.record.metrics
    asked, k = config.grouping.k, int(metrics["k"] or 0)
    if asked not in ("auto", k):
        raise _impossible(GROUPING.name, f"no groups of {asked}: {metrics['k_reason']}")
    if share:
        domes = max(1, round(share * int(metrics["train_views"] or 0) / k))
        config = scene.config((*changes, f"sampling.domes={domes}"))
    stages = (SAMPLING, RENDERING, DATASET, *_MODEL) if share else (DATASET_OF_PHOTOS, *_MODEL)
    seen = {**given, GROUPING.name: grouped.record}
    for visit in walk(store, stages, config, Material(), make, seen, folds=False):
        yield visit
        if visit.step.stage is DATASET and visit.record and not visit.record.metrics["groups_rendered"]:
            raise _impossible(DATASET.name, "no dome of virtual views could be placed and rendered completely")


def _impossible(stage: str, why: str) -> StageFailed:
    failure = StageFailed(stage, "refused", why, "", "", "")
    failure.problem = why  # without "stage ... failed": the stage itself did not fail
    return failure


def _check_split(store: Store, scene: FinishedScene, cell: Cell[PaperArm], grouping: Record) -> None:
    """Check that a cell has the scene's own split: the mesh was made from photographs that another split would test."""
    if not read_split(store, grouping).equals(scene.split(store, cell.fold)):
        raise UsageError(
            f"these settings give another test than scene {scene.name!r} was made with",
            "leave the split's settings (grouping.test_share, folds, gap_...) as they are, or run the scene with them first",
        )
