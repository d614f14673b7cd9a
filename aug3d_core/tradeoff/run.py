"""Make arms. What a killed study made is in the store, so the same call goes on where it was."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
import pandas as pd

from aug3d_core.bench.trial import Say, Trial, run_trial
from aug3d_core.charts.pooled import pooled, test_views
from aug3d_core.errors import UsageError
from aug3d_core.stage import Metric
from aug3d_core.store import layout
from aug3d_core.store.store import Store
from aug3d_core.tradeoff.arm import REFUSED, Arm, Result
from aug3d_core.tradeoff.scene import StudiedScene
from aug3d_core.tradeoff.setting import TEST_PSNR, Judge, value_of

Objects = frozenset[tuple[str, str]]  # stage and key
Done = Callable[[Result, int, int], None]  # a result, how many are done, of how many


def objects_there(store: Store) -> Objects:
    """Return what the store holds."""
    return frozenset(
        (record.parent.parent.name, record.parent.name)
        for record in (store.root / layout.OBJECTS).glob(f"*/[!.]*/{layout.RECORD}")
    )


def make_arm(store: Store, scene: StudiedScene, arm: Arm, seed: int, there: Objects, say: Say) -> Result:
    """Make an arm, or find it made; a stage that fails ends the arm, not the study, unless the disk is full.

    A value beyond the bounds of its setting, as twice or half of the scene's own may be, is refused like one that a stage
    cannot use.
    What is tested on held-out photographs is made in all folds of the scene: one fold of few photographs tests two.
    """
    own = scene.decided() if arm.mark == "auto" else scene.own
    try:
        config = own.config(arm.settings)
    except UsageError as error:
        return Result(arm, seed, Trial({}, error.problem, REFUSED))
    # Counted from the scene's own seed, whichever that is: no two repeats are the same
    repeated = (f"{field}={int(value_of(field, config)) + seed}" for field in arm.seeded if seed)
    settings = (*arm.settings, *repeated)
    trial = run_trial(
        store,
        arm.judge.stage,
        own,
        settings,
        say,
        scene.photos,
        afresh=True,
        folds=arm.judge.stage == TEST_PSNR.stage,
    )
    found = sum((record.stage, record.key) in there for record in trial.records.values())
    return Result(arm, seed, trial, found, _figures(store, trial, arm.judge), _held_out(store, trial))


def _figures(store: Store, trial: Trial, judge: Judge) -> Mapping[str, Metric]:
    """Return what the judging stage measured, a test over all folds; nothing of what failed in one."""
    judged = trial.of([judge.stage])
    if trial.failure or not judged:
        return {}
    tested = judge.stage == TEST_PSNR.stage
    return pooled([(record, store.files_dir(record)) for record in judged]) if tested else judged[0].metrics


def _held_out(store: Store, trial: Trial) -> dict[str, float]:
    """Return the PSNR (dB) of each test photograph of all folds, by the name of its file."""
    tests = trial.of([TEST_PSNR.stage])
    if trial.failure or not tests:
        return {}
    photos = pd.read_parquet(
        store.files_dir(trial.records["photos"]) / layout.PHOTO_TABLE, columns=["photo_id", "name"]
    )
    told = test_views([store.files_dir(record) for record in tests]).merge(photos, on="photo_id")
    return dict(zip(told["name"].astype(str), told["psnr"].astype(float), strict=True))


def make_all(
    store: Store, scene: StudiedScene, cells: Iterable[tuple[Arm, int]], there: Objects, say: Say, done: Done
) -> list[Result]:
    """Make arms with their seeds in an order drawn by lot, so that a slow hour of the machine favours none."""
    drawn: Sequence[tuple[Arm, int]] = list(cells)
    results: dict[int, Result] = {}
    for index in np.random.default_rng(0).permutation(len(drawn)):
        arm, seed = drawn[index]
        results[int(index)] = make_arm(store, scene, arm, seed, there, say)
        done(results[int(index)], len(results), len(drawn))
    return [results[index] for index in sorted(results)]
