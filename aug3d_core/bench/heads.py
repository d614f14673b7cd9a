"""Heads against the cheap answers, against each other, and on a place that the head never saw; at the preset's size."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from aug3d_core.bench.figure import Figure, at_least, at_most, names_of, told
from aug3d_core.factory.material import Source, source_of
from aug3d_core.factory.stages import STAGES
from aug3d_core.judging.config import EvaluationConfig
from aug3d_core.judging.files import TEST_VIEWS
from aug3d_core.judging.summary import lead
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say, Trial, directly, run_trial, single, tried

SWEEP, PIXELNERF = ("training.head=sweep",), ("training.head=pixelnerf",)
FROM_INPUTS = (
    "ground_homography",
    "plane_sweep",
)  # the cheap answers that a model from the inputs alone is held against
MINUTES = 10  # of processor time for training
FEW_STEPS = 100  # enough to know how long a step of PixelNeRF takes
# SSIM from the inputs alone; over cheap answers [dB]: from the inputs alone, then over those of the mesh with a scaffold
TOWN_GOALS = {"ssim": 0.75, "ground_homography": 3.0, "plane_sweep": 3.0, "mesh_render": 2.0, "guided_blend": 0.7}
REAL_GOALS = {"mesh_render": 1.5, "guided_blend": 0.5}


def figures(store: Store, scene: Measured, say: Say, photos: tuple[Path, ...]) -> dict[str, Figure]:
    """Measure the sweep on the town and on folders of photographs, PixelNeRF beside it, and the town's sweep on the others."""
    sweep = _trial(store, scene, say, SWEEP)
    if sweep.failure:
        return {"town": Figure(None, "dB", None, None, sweep.failure)}
    found = _scene_figures(store, sweep, "town", TOWN_GOALS) | _cost(sweep) | _pixelnerf(store, scene, say, sweep)
    for name, folder in zip(names_of(photos), photos, strict=True):
        other = _trial(store, scene, say, SWEEP, folder)
        if other.failure:
            found[name] = Figure(None, "dB", None, None, other.failure)
            continue
        found |= _scene_figures(store, other, name, REAL_GOALS)
        elsewhere = _elsewhere(store, say, sweep, other)
        found |= _scene_figures(store, elsewhere, f"{name}_never_seen", {})
    return found


def _trial(store: Store, scene: Measured, say: Say, head: tuple[str, ...], photos: Path | None = None) -> Trial:
    settings = Measured(scene.preset, (*head, *scene.overrides))
    return run_trial(store, "evaluation", settings, (), directly(store, say), photos)


def _scene_figures(store: Store, trial: Trial, name: str, goals: Mapping[str, float]) -> dict[str, Figure]:
    """Return the scores of both ways to start, and their leads with the lower ends of their intervals."""
    views = pd.read_parquet(store.file(trial.records["evaluation"], TEST_VIEWS))
    found = {
        f"{name}_psnr": Figure(_mean(views, "psnr"), "dB"),
        f"{name}_ssim": Figure(_mean(views, "ssim"), "1"),
    }
    alone = "inputs_alone_psnr" if "inputs_alone_psnr" in views else "psnr"
    found[f"{name}_inputs_alone_psnr"] = Figure(_mean(views, alone), "dB")
    ssim = _mean(views, alone.replace("psnr", "ssim"))
    found[f"{name}_inputs_alone_ssim"] = at_least(goals["ssim"], ssim, "1") if "ssim" in goals else Figure(ssim, "1")
    for answer in ("ground_homography", "plane_sweep", "mesh_render", "guided_blend"):
        of = alone if answer in FROM_INPUTS else "psnr"
        mean, ends = lead(views, of, f"{answer}_psnr")
        goal = goals.get(answer)
        found[f"{name}_over_{answer}"] = at_least(goal, mean, "dB") if goal else Figure(mean, "dB")
        found[f"{name}_over_{answer}_low"] = at_least(0.0, ends[0] if ends else None, "dB")
    return found


def _mean(views: pd.DataFrame, column: str) -> float:
    return float(np.asarray(views[column], float).mean())


def _cost(trial: Trial) -> dict[str, Figure]:
    return {
        "town_training_processor_minutes": at_most(MINUTES, trial.cpu_seconds(["training"]) / 60, "min"),
        "town_training_mib": at_most(3 * 1024, trial.peak_mib(["training"]), "MiB"),
        "town_seconds_per_view": Figure(told(trial, "evaluation", "seconds_per_view"), "s"),
    }


def _pixelnerf(store: Store, scene: Measured, say: Say, sweep: Trial) -> dict[str, Figure]:
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
    alone = told(sweep, "evaluation", "inputs_alone_psnr_mean")
    over = alone - psnr if alone is not None and psnr is not None else None
    return {
        "town_pixelnerf_steps": Figure(steps, "steps"),
        "town_pixelnerf_psnr": Figure(psnr, "dB", None, None, whole.failure),
        "town_inputs_alone_over_pixelnerf": at_least(2.0, over, "dB"),
    }


def _elsewhere(store: Store, say: Say, trained: Trial, judged: Trial) -> Trial:
    """Judge a head on the data set of a scene that it was not trained on."""
    sources: dict[str, Source] = {
        "dataset": source_of(store, judged.records["dataset"]),
        "training": source_of(store, trained.records["training"]),
    }
    config = EvaluationConfig(**judged.records["evaluation"].config).model_copy(update={"flythrough_frames": 0})
    return tried(single(STAGES["evaluation"], config, sources, directly(store, say)))
