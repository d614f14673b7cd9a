"""Heads against the cheap answers, against each other, and on a place that the head never saw; at the preset's size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from aug3d_core.bench.figure import Figure, at_least, at_most, in_own_process, told
from aug3d_core.bench.scores import scene_scores
from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.reader import read
from aug3d_core.dataset.scene import Scene
from aug3d_core.factory.material import Source, source_of
from aug3d_core.factory.stages import STAGES
from aug3d_core.heads.head import Head
from aug3d_core.heads.saved import load
from aug3d_core.judging.config import EvaluationConfig
from aug3d_core.judging.files import TEST_VIEWS
from aug3d_core.judging.scores import Judged, evaluate
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say, Trial, directly, run_trial, single, tried

SWEEP, PIXELNERF = ("training.head=sweep",), ("training.head=pixelnerf",)
MINUTES = 10  # of processor time for training
FEW_STEPS = 100  # enough to know how long a step of PixelNeRF takes
SECONDS = {256: 0.3, 512: 1.2}  # of a view, by its width [px]
GOALS = {
    "town": {
        "free_ssim": 0.75,
        "free_over_homography_db": 3.0,
        "free_over_sweep_db": 3.0,
        "scaffold_over_mesh_db": 2.0,
        "scaffold_over_guided_db": 0.7,
    },
    "ochota": {"free_over_best_cheap_db": 2.5, "scaffold_over_mesh_db": 1.5, "scaffold_over_guided_db": 0.5},
    "brighton": {"free_over_best_cheap_db": 1.0, "scaffold_over_mesh_db": 1.5, "scaffold_over_guided_db": 0.5},
    "ochota_never_seen": {"free_over_homography_db": 2.5},
    "brighton_never_seen": {"free_over_homography_db": 1.0},
}


def figures(store: Store, scene: Measured, say: Say, photos: Mapping[str, Path]) -> dict[str, Figure]:
    """Measure the sweep on the town and on folders of photographs, PixelNeRF beside it, and the town's sweep on the others."""
    sweep = _trial(store, scene, say, SWEEP)
    if sweep.failure:
        return {"town": Figure(None, "dB", None, None, sweep.failure)}
    found = _scores(store, sweep, "town") | _cost(sweep) | _sizes(store, scene, say, sweep)
    found |= _untrained(store, scene, say) | _pixelnerf(store, scene, say, sweep, found["town_free_psnr"].value)
    for name, folder in photos.items():
        other = _trial(store, scene, say, SWEEP, folder)
        found |= _scores(store, other, name)
        if not other.failure:
            found |= _scores(store, _elsewhere(store, say, sweep, other), f"{name}_never_seen")
    return found


def _trial(store: Store, scene: Measured, say: Say, head: tuple[str, ...], photos: Path | None = None) -> Trial:
    settings = Measured(scene.preset, (*head, *scene.overrides))
    return run_trial(store, "evaluation", settings, (), directly(store, say), photos)


def _scores(store: Store, trial: Trial, name: str) -> dict[str, Figure]:
    if trial.failure:
        return {name: Figure(None, "dB", None, None, trial.failure)}
    views = pd.read_parquet(store.file(trial.records["evaluation"], TEST_VIEWS))
    return scene_scores(views, name, GOALS.get(name, {}))


def _cost(trial: Trial) -> dict[str, Figure]:
    return {
        "train_processor_seconds": at_most(60 * MINUTES, trial.cpu_seconds(["training"]), "s"),
        "train_peak_mib": at_most(3 * 1024, trial.peak_mib(["training"]), "MiB"),
    }


def _sizes(store: Store, scene: Measured, say: Say, sweep: Trial) -> dict[str, Figure]:
    """Return how long the town's model takes for a view from the inputs alone, and for that and one about the scaffold [s]."""
    found = {}
    model = store.files_dir(sweep.records["training"])
    for width, most in SECONDS.items():
        size = (f"dataset.width_px={width}", f"dataset.height_px={width * 3 // 4}")
        packed = run_trial(
            store, "dataset", Measured(scene.preset, (*scene.overrides, *size)), (), directly(store, say)
        )
        if packed.failure:
            found[f"view_seconds_{width}"] = Figure(None, "s", None, None, packed.failure)
            continue
        data = store.files_dir(packed.records["dataset"]) / SCENE_ZARR
        free, both = in_own_process(partial(seconds_per_view, model, data))
        found |= {f"view_seconds_{width}": at_most(most, free, "s"), f"both_views_seconds_{width}": Figure(both, "s")}
    return found


def seconds_per_view(model: Path, data: Path) -> tuple[float, float]:
    """Return the wall seconds of a view from three inputs alone, and with one about the scaffold: medians of test views."""
    head, packed = load(model), read(data)
    free = replace(packed, scaffold=np.zeros_like(packed.scaffold))
    taken = [
        np.median([judged.seconds for judged in _judged(head, one, EvaluationConfig(input_views=3))])
        for one in (free, free, packed)  # the first time, memory is asked for
    ]
    return float(taken[1]), float(taken[2])


def _judged(head: Head, scene: Scene, config: EvaluationConfig) -> list[Judged]:
    kept: list[Judged] = []
    evaluate(head, scene, config, lambda group, judged: kept.append(judged))
    return kept


def _untrained(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Return what the head makes of the town with random weights: what its geometry alone is worth."""
    as_it_begins = ("training.head.start=random", "training.steps=0", "evaluation.flythrough_frames=0")
    trial = _trial(store, scene, say, (*SWEEP, *as_it_begins))
    return {
        "untrained_psnr": Figure(told(trial, "evaluation", "inputs_alone_psnr_mean"), "dB", None, None, trial.failure)
    }


def _pixelnerf(store: Store, scene: Measured, say: Say, sweep: Trial, free: float | None) -> dict[str, Figure]:
    """Train PixelNeRF for as long [processor time], and say how far the sweep from the inputs alone is above it."""
    short = _trial(store, scene, say, (*PIXELNERF, f"training.steps={FEW_STEPS}", "evaluation.flythrough_frames=0"))
    if short.failure:
        return {"town_pixelnerf_psnr": Figure(None, "dB", None, None, short.failure)}
    step_seconds = short.cpu_seconds(["training"]) / FEW_STEPS
    steps = max(int(sweep.cpu_seconds(["training"]) / step_seconds), 1)
    whole = _trial(
        store, scene, say,
        (*PIXELNERF, f"training.steps={steps}", "training.least_gain_db=0", "evaluation.flythrough_frames=0"),
    )  # fmt: skip
    psnr = told(whole, "evaluation", "test_psnr_mean")
    over = free - psnr if free is not None and psnr is not None else None
    return {
        "town_pixelnerf_steps": Figure(steps, "steps"),
        "town_pixelnerf_psnr": Figure(psnr, "dB", None, None, whole.failure),
        "town_free_over_pixelnerf_db": at_least(2.0, over, "dB"),
    }


def _elsewhere(store: Store, say: Say, trained: Trial, packed: Trial) -> Trial:
    """Judge a head on a data set that it was not trained on."""
    sources: dict[str, Source] = {
        "dataset": source_of(store, packed.records["dataset"]),
        "training": source_of(store, trained.records["training"]),
    }
    config = EvaluationConfig(**trained.records["evaluation"].config).model_copy(update={"flythrough_frames": 0})
    return tried(single(STAGES["evaluation"], config, sources, directly(store, say)))
