"""Make the cells of a study, in a random order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from aug3d_core.factory.walk import Make
from aug3d_core.judging.files import TEST_VIEWS
from aug3d_core.metrics.pooled import pooled, test_views
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.run.errors import UsageError
from aug3d_core.run.stage import Metric
from aug3d_core.store import layout
from aug3d_core.store.store import Store
from aug3d_core.studies.common.cell import Cell, Done, make_cells
from aug3d_core.studies.common.trial import Trial, afresh, run_trial
from aug3d_core.studies.tradeoff.arm import REFUSED, TradeoffArm, TradeoffResult
from aug3d_core.studies.tradeoff.scene import StudiedScene
from aug3d_core.studies.tradeoff.setting import TEST_PSNR, Judge, value_of

Objects = frozenset[tuple[str, str]]  # stage and key


def objects_there(store: Store) -> Objects:
    """Return the objects in the store."""
    return frozenset(
        (record.parent.parent.name, record.parent.name)
        for record in (store.root / layout.OBJECTS).glob(f"*/[!.]*/{layout.RECORD}")
    )


def make_arm(store: Store, scene: StudiedScene, cell: Cell[TradeoffArm], there: Objects, make: Make) -> TradeoffResult:
    """Make a cell. A stage that fails ends the cell, not the study, unless the disk is full.

    A value outside the bounds of its setting, as a multiple of the scene's own may be, counts as refused.
    What is tested on held-out photographs is made in all folds of the scene: one fold of a small scene tests two photographs.
    """
    arm, tested = cell.arm, cell.arm.judge.stage == TEST_PSNR.stage
    own = scene.decided() if arm.mark == "auto" else scene.own
    try:
        config = own.config(arm.settings)
    except UsageError as error:
        return TradeoffResult(cell, Trial({}, error.problem, REFUSED))
    # Counted from the scene's own seed, so that no two repeats are the same.
    repeated = (f"{field}={int(value_of(field, config)) + cell.seed}" for field in arm.seeded if cell.seed)
    settings = (*arm.settings, *repeated)
    trial = run_trial(store, arm.judge.stage, own, settings, afresh(make), scene.photos, folds=tested)
    found = sum((record.stage, record.key) in there for record in trial.records.values())
    return TradeoffResult(cell, trial, found, _figures(store, trial, arm.judge), _held_out(store, trial))


def _figures(store: Store, trial: Trial, judge: Judge) -> Mapping[str, Metric]:
    """Return the metrics of the judging stage, of a test over all folds; none if a fold failed."""
    judged = trial.of([judge.stage])
    if trial.failure or not judged:
        return {}
    tested = judge.stage == TEST_PSNR.stage
    return (
        pooled([(record, store.files_dir(record, [TEST_VIEWS])) for record in judged]) if tested else judged[0].metrics
    )


def _held_out(store: Store, trial: Trial) -> dict[str, float]:
    """Return the PSNR [dB] of each test photograph of all folds, by the name of its file."""
    tests = trial.of([TEST_PSNR.stage])
    if trial.failure or not tests:
        return {}
    photos = pd.read_parquet(store.file(trial.records["photos"], PHOTO_TABLE), columns=["photo_id", "name"])
    tested = test_views([store.files_dir(record, [TEST_VIEWS]) for record in tests]).merge(photos, on="photo_id")
    return dict(zip(tested["name"].astype(str), tested["psnr"].astype(float), strict=True))


def make_shuffled(
    store: Store,
    scene: StudiedScene,
    cells: Sequence[Cell[TradeoffArm]],
    there: Objects,
    make: Make,
    done: Done[TradeoffResult],
) -> list[TradeoffResult]:
    """Make cells in a random order, so that a slow hour of the machine favours none; return results in the given order."""
    order = np.random.default_rng(0).permutation(len(cells))
    results = make_cells(
        store, [cells[index] for index in order], lambda cell: make_arm(store, scene, cell, there, make), done
    )
    return [results[place] for place in np.argsort(order)]
