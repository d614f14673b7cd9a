"""The stage `training`: dataset -> a trained head."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from aug3d_core.dataset.batches import given_views
from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.on_disk import Cache
from aug3d_core.dataset.reader import read
from aug3d_core.dataset.scene import Scene
from aug3d_core.heads import saved
from aug3d_core.heads.config import Measures
from aug3d_core.run.errors import InputError
from aug3d_core.run.stage import Metric, Outcome, Progress
from aug3d_core.training.config import TrainingConfig
from aug3d_core.training.ddp import Team, fitting_size, gathered
from aug3d_core.training.decisions import steps_made
from aug3d_core.training.divergence import worse_than_one_colour
from aug3d_core.training.files import CHECKPOINT, CURVE
from aug3d_core.training.loop import train
from aug3d_core.training.schedule import last_step
from aug3d_core.training.state import Run

CURVE_POINTS = 100
NOT_LEARNED = "the model is no better than one colour for each view would be: train longer, or with another seed"


def run(inputs: Mapping[str, Path], config: TrainingConfig, out: Path, progress: Progress) -> Outcome:
    """Train, on all devices there are; the checkpoints go when the model is written, for they hold times."""
    checkpoints = out / CHECKPOINT
    every = max(config.steps // 200, 1)

    def report(run: Run) -> None:
        end = last_step(config, run.tail_from)
        if run.step % every == 0 or run.step == end:
            progress(run.step, end, f"{psnr(run.history[-every:]):.1f} dB in training")

    stores = {name: inputs[name] / SCENE_ZARR for name in sorted(inputs)}
    with gathered(
        fitting_size(config.groups_per_step, torch.cuda.device_count()), _follow, stores, config, checkpoints
    ) as team:
        scenes = list(read_all(stores).values())
        trained = train(scenes, config, checkpoints, report, team)
    saved.save(trained.head, out)
    curve = curve_of(trained)
    curve.to_parquet(out / CURVE, index=False)
    shutil.rmtree(checkpoints, ignore_errors=True)
    collapsed = bool(trained.history) and worse_than_one_colour(trained.history)
    metrics = _metrics(trained, config, len(scenes))
    if len(curve):
        metrics["train_psnr"] = round(float(curve["train_psnr"].iloc[-1]), 3)
    return Outcome(
        metrics=metrics,
        state="degraded" if collapsed else "ok",
        notes=(
            *trained.start.notes,
            *_fewer(scenes, config),
            *_restarts(trained, config),
            *((NOT_LEARNED,) if collapsed else ()),
        ),
        series={
            name: tuple(zip(curve["step"].tolist(), curve[name].tolist(), strict=True))
            for name in curve.columns[1:]
            if len(curve)
        },
        decisions=(steps_made(metrics, config), *trained.start.decisions),
    )


def read_all(stores: Mapping[str, Path]) -> dict[str, Scene]:
    """Read the data sets that a head is trained on, by name; of their pictures as many are in memory as the usual cache holds.

    Raises InputError that names the data set that cannot be trained on.
    """
    cache, scenes = Cache(), {}
    for name, store in stores.items():
        try:
            scenes[name] = read(store, cache)
        except InputError as error:
            raise InputError(f"{name}: {error.problem}", error.remedy) from error
    return scenes


def _follow(team: Team, stores: Mapping[str, Path], config: TrainingConfig, checkpoints: Path) -> None:
    """Train as another member of the team, silently."""
    train(list(read_all(stores).values()), config, checkpoints, team=team)


def _metrics(run: Run, config: TrainingConfig, scenes: int) -> dict[str, Metric]:
    return {
        "head": config.head.name,
        "scenes": scenes,
        "steps": run.step,
        "stopped_by": "steps" if run.step == config.steps else "plateau",
        "restarts": len(run.restarts),
        "groups_per_second": round(run.step * config.groups_per_step / max(run.seconds, 1e-9), 2),
        "loader_wait_share": round(run.waited / max(run.seconds, 1e-9), 4),
        "parameters": sum(p.numel() for p in run.head.parameters()),
        **run.start.metrics,
    }


def _fewer(scenes: Sequence[Scene], config: TrainingConfig) -> list[str]:
    given = min(given_views(scene, config.wanted) for scene in scenes)
    told = f"the smallest group has {given + 1} views: {given} of each were given, not {config.input_views}"
    return [told] if given < config.input_views else []


def _restarts(run: Run, config: TrainingConfig) -> list[str]:
    return [
        f"at step {trouble.seen_at} {trouble.what}: training went back to step {step}"
        f" and on at a learning rate of {config.learning_rate / 3**count:.2g}"
        for count, (trouble, step) in enumerate(run.restarts, start=1)
    ]


def curve_of(run: Run) -> pd.DataFrame:
    """Return the curve in at most CURVE_POINTS windows: last step of each, PSNR and loss over it."""
    windows = np.array_split(np.arange(run.step), min(CURVE_POINTS, run.step)) if run.step else []
    parts = [run.history[w[0] : w[-1] + 1] for w in windows]
    return pd.DataFrame(
        {
            "step": [int(w[-1]) + 1 for w in windows],
            "train_psnr": [psnr(part) for part in parts],
            "train_loss": [float(np.mean([step["loss"] for step in part])) for part in parts],
        }
    )


def psnr(steps: Sequence[Measures]) -> float:
    """Return the PSNR in dB of the mean squared error of some steps, of colours in [0, 1]."""
    return float(-10 * np.log10(max(np.mean([step["error"] for step in steps]), 1e-10)))
