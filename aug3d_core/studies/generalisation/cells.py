"""What is trained for each scene that is left out, and judged on its test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pandas as pd

from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.collections.made import MadeCollection
from aug3d_core.factory.config import SceneConfig, overridden
from aug3d_core.factory.material import Source, source_of
from aug3d_core.factory.plan import Step
from aug3d_core.factory.stages import EVALUATION, PREVIEW, TRAINING
from aug3d_core.factory.walk import Make
from aug3d_core.heads.config import config_of, title_of
from aug3d_core.heads.files import MODEL_WEIGHTS
from aug3d_core.judging.files import TEST_VIEWS
from aug3d_core.novel.config import PreviewConfig
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from aug3d_core.studies.common.cell import Cell, Result
from aug3d_core.studies.common.trial import Trial, single, tried
from aug3d_core.training.config import TrainingConfig

Way = Literal["never seen", "tuned", "alone"]
WAYS: tuple[Way, ...] = ("never seen", "tuned", "alone")
TUNED_SHARE = 0.1  # of the steps from random weights


@dataclass(frozen=True)
class LeftOut:
    """A scene that is left out, how the model came to it, and which head it is."""

    scene: str
    way: Way
    head: str

    @property
    def name(self) -> str:
        """Its name in progress messages, tables and MLflow."""
        return f"{self.scene}, {self.way}, {title_of(self.head)}"


@dataclass(frozen=True)
class Generalised(Result[LeftOut]):
    """The result of a cell. views: the scores on the tests of all folds, None if there are none. paid: of the first fold.

    preview: what the model that never saw the scene shows of its photographs before any prediction.
    """

    views: pd.DataFrame | None = None
    preview: Record | None = None

    @property
    def paid(self) -> list[Record]:
        """The training alone; a tuned model pays for its tuning."""
        return [record for step, record in self.records.items() if step == TRAINING.name]


def cells_of(entry: CollectionEntry, heads: tuple[str, ...], seeds: int) -> list[Cell[LeftOut]]:
    """Return the cells: each scene left out, in every way, with every head that can be tuned where that is asked."""
    return [
        Cell(LeftOut(scene, way, head), seed)
        for seed in range(seeds)
        for scene in (*entry.train, *entry.hold_out)
        for head in heads
        for way in WAYS
        if way != "tuned" or "start" in config_of(head).model_fields
    ]


def make_cell(
    store: Store, entry: CollectionEntry, made: MadeCollection, cell: Cell[LeftOut], make: Make
) -> Generalised:
    """Train and judge. What other cells trained is found in the store."""
    arm = cell.arm
    config = _config(entry.config(), arm.head, entry.preset, cell.seed)
    data = made.members[arm.scene].data
    if not data:
        return Generalised(cell, Trial({}, made.members[arm.scene].trouble, "refused"))
    others = {name: source_of(store, record) for name, record in made.trained_on(without=arm.scene).items()}
    if arm.way != "alone" and not others:
        return Generalised(cell, Trial({}, "there is no other scene, and no town, to train on", "refused"))
    general = None if arm.way == "alone" else _trained(config, others, make)
    records, tables = {}, []
    for fold, record in enumerate(data.values()):
        own = {arm.scene: source_of(store, record)}
        # What one fold holds out the others show: each has a model of its own, unless none of them was seen
        trial = general
        if trial is None:
            trial = _trained(config.from_random(), own, make)
        elif arm.way == "tuned" and not trial.failure:
            trial = _trained(_tuning(config, store.file(trial.records[TRAINING.name], MODEL_WEIGHTS)), own, make)
        if not trial.failure:
            records.setdefault(
                Step(TRAINING, 0 if arm.way == "never seen" else fold).name, trial.records[TRAINING.name]
            )
            trial = _judged(store, entry.config(), record, trial, make)
        if trial.failure:
            return Generalised(cell, Trial(records, trial.failure, trial.cause, trial.at))
        evaluation = records[Step(EVALUATION, fold).name] = trial.records[EVALUATION.name]
        tables.append(pd.read_parquet(store.file(evaluation, TEST_VIEWS)))
    judged = Generalised(cell, Trial(records), views=pd.concat(tables, ignore_index=True))
    poses = made.members[arm.scene].poses
    return judged if arm.way != "never seen" or poses is None else _previewed(store, judged, poses, make)


def _tuning(config: TrainingConfig, weights: Path) -> TrainingConfig:
    """Return how a model goes on from these weights on one scene."""
    steps = max(round(TUNED_SHARE * config.from_random().steps), 1)
    few = {"steps": steps, "warmup_steps": min(config.warmup_steps, steps // 10), "least_gain_db": 0.0}
    return config.started(str(weights)).model_copy(update=few)


def _judged(store: Store, config: SceneConfig, record: Record, trained: Trial, make: Make) -> Trial:
    quick = config.evaluation.model_copy(update={"panels": 0, "flythrough_frames": 0})
    model = source_of(store, trained.records[TRAINING.name])
    return tried(single(EVALUATION, quick, {"dataset": source_of(store, record), "training": model}, make))


def _previewed(store: Store, judged: Generalised, poses: Record, make: Make) -> Generalised:
    """Ask the preview, which knows photographs and poses alone, what it says of the model here."""
    if judged.failure:
        return judged
    sources = {
        name: source_of(store, record) for name, record in (("sfm", poses), ("training", judged.records["training"]))
    }
    trial = tried(single(PREVIEW, PreviewConfig(frames=0), sources, make))
    if trial.failure:
        return Generalised(judged.cell, trial)
    both = Trial({**judged.records, **trial.records})
    return Generalised(judged.cell, both, judged.views, trial.records[PREVIEW.name])


def _config(config: SceneConfig, head: str, preset: str, seed: int) -> TrainingConfig:
    if config.training.head.name != head:
        config = overridden(config, [f"training.head={head}"], preset)
    return config.training.model_copy(update={"seed": seed})


def _trained(config: TrainingConfig, sources: Mapping[str, Source], make: Make) -> Trial:
    return tried(single(TRAINING, config, sources, make))
