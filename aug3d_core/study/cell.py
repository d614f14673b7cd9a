"""One run of an arm: groups, virtual views if it has any, data set, model, test.

Every step is an object of the store: arms share what they have in common, and what a killed study made is found again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from aug3d_core.bench.trial import ends_all
from aug3d_core.errors import StageFailed, UsageError
from aug3d_core.make import make, source_of
from aug3d_core.scene_config import SceneConfig
from aug3d_core.stage import Stage
from aug3d_core.stages import DATASET, DATASET_OF_PHOTOS, EVALUATION, GROUPING, RENDERING, SAMPLING, TRAINING
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from aug3d_core.study.arm import Arm
from aug3d_core.study.scene import FinishedScene, read_split

Say = Callable[[str, int, int, str], None]  # stage, done, total, what


@dataclass(frozen=True)
class Cell:
    """An arm with a seed of the network, in a fold of the scene."""

    arm: Arm
    seed: int
    fold: int

    @property
    def name(self) -> str:
        """How progress, tables and MLflow call it."""
        return f"{self.arm.key}, seed {self.seed}" + (f", fold {self.fold}" if self.fold else "")


@dataclass(frozen=True)
class Result:
    """What became of a cell. views: its rows of the test's table, empty if `failure` says why there are none."""

    cell: Cell
    records: Mapping[str, Record]
    views: pd.DataFrame = field(default_factory=pd.DataFrame)
    failure: str = ""

    @property
    def notes(self) -> tuple[str, ...]:
        """What its steps warn of; training's restarts too, which end well."""
        doubtful = (r for r in self.records.values() if r.state == "degraded" or r.stage == "training")
        return tuple(f"{record.stage}: {note}" for record in doubtful for note in record.notes)

    @property
    def failed(self) -> bool:
        """Whether it has no score, or the score of a network that has learned nothing."""
        return bool(self.failure) or self.records["training"].state == "degraded"

    def metric(self, stage: str, name: str) -> float | None:
        """Return a figure of a step as a number, None if there is none."""
        value = self.records[stage].metrics.get(name) if stage in self.records else None
        return float(value) if isinstance(value, int | float) else None

    def mean(self, score: str) -> float | None:
        """Return the mean of a score over the test photographs, None where there is none."""
        return None if self.failure else float(np.mean(np.asarray(self.views[score], float)))

    @property
    def seconds(self) -> float:
        """Wall time of training and test."""
        return sum(self.records[s].seconds for s in ("training", "evaluation") if s in self.records)

    @property
    def cpu_seconds(self) -> float:
        """Processor time of training and test, whatever else the machine was doing."""
        return sum(self.records[s].cpu_seconds or 0.0 for s in ("training", "evaluation") if s in self.records)


def make_cell(store: Store, scene: FinishedScene, cell: Cell, say: Say) -> Result:
    """Make a cell, or find it made; a step that fails ends the cell, not the study.

    Raises UsageError where the settings move the scene's test, StoreError where every other cell would fail too.
    """
    made: dict[str, Record] = {}
    try:
        why_not = _make_steps(store, scene, cell, made, say)
    except StageFailed as failure:
        ends_all(failure)
        why_not = failure.problem
    if why_not:
        return Result(cell, made, failure=why_not)
    views = pd.read_parquet(store.files_dir(made["evaluation"]) / layout.TEST_VIEWS)
    if not np.isfinite(views["psnr"]).all():
        return Result(cell, made, failure=f"the test gives no number for {(~np.isfinite(views['psnr'])).sum()} photos")
    return Result(cell, made, views)


def _make_steps(store: Store, scene: FinishedScene, cell: Cell, made: dict[str, Record], say: Say) -> str:
    """Make the steps in turn; return why the cell cannot be what it is called, empty if it can."""
    given = scene.given(cell.fold)
    config = scene.config((*cell.arm.settings, f"grouping.fold={cell.fold}", f"training.seed={cell.seed}"))

    def step(stage: Stage, settings: SceneConfig = config) -> Record:
        there = {**given, **made}
        sources = {name: source_of(store, there[name], stage.reads.get(name, ())) for name in stage.inputs}
        made[stage.name] = make(
            store, stage, getattr(settings, stage.name), sources, lambda *told: say(stage.name, *told)
        )
        return made[stage.name]

    grouping = step(GROUPING)
    _check_split(store, scene, cell, grouping)
    asked, k = config.grouping.k, int(grouping.metrics["k"] or 0)
    if asked not in ("auto", k):
        return f"no groups of {asked}: {grouping.metrics['k_reason']}"
    if not cell.arm.rendered_share:
        step(DATASET_OF_PHOTOS)
    else:
        photos = int(grouping.metrics["train_views"] or 0)
        domes = max(1, round(cell.arm.rendered_share * photos / k))
        step(SAMPLING, scene.config((*cell.arm.settings, f"sampling.domes={domes}")))
        step(RENDERING)
        if not step(DATASET).metrics["groups_rendered"]:
            return "no dome of virtual views could be placed and rendered whole"
    step(TRAINING)
    step(EVALUATION)
    return ""


def _check_split(store: Store, scene: FinishedScene, cell: Cell, grouping: Record) -> None:
    """Hold every cell to the scene's own split: its mesh saw the photographs that another split would test."""
    if not read_split(store, grouping).equals(scene.split(store, cell.fold)):
        raise UsageError(
            f"these settings give another test than scene {scene.name!r} was made with",
            "leave the split's settings (grouping.test_share, folds, gap_...) as they are, or run the scene with them first",
        )
