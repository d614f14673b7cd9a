"""The stage `training`: dataset -> model."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from aug3d_core.dataset.reader import read
from aug3d_core.nerf.checkpoint import save_model
from aug3d_core.nerf.config import TrainingConfig
from aug3d_core.nerf.training import Run, train
from aug3d_core.stage import Outcome, Progress
from aug3d_core.store import layout

CURVE_POINTS = 100


def run(inputs: Mapping[str, Path], config: TrainingConfig, out: Path, progress: Progress) -> Outcome:
    """Train; the checkpoint goes when the model is written, since it holds times and is of no more use."""
    scene = read(inputs["dataset"] / layout.SCENE_ZARR)
    checkpoints = out / layout.CHECKPOINT
    every = max(config.steps // 200, 1)

    def report(run: Run) -> None:
        step = len(run.losses)
        if step % every == 0 or step == config.steps:
            progress(step, config.steps, f"{psnr(run.errors[-every:]):.1f} dB in training")

    trained = train(scene, config, checkpoints, report)
    save_model(trained.model, out)
    curve = curve_of(trained)
    curve.to_parquet(out / layout.CURVE, index=False)
    shutil.rmtree(checkpoints, ignore_errors=True)
    rays = config.steps * config.groups_per_step * config.rays_per_group
    return Outcome(
        metrics={
            "train_psnr": round(float(curve["train_psnr"].iloc[-1]), 3),
            "steps": config.steps,
            "rays_per_second": round(rays / max(trained.seconds, 1e-9), 1),
            "parameters": sum(p.numel() for p in trained.model.parameters()),
        },
        series={
            name: tuple(zip(curve["step"].tolist(), curve[name].tolist(), strict=True)) for name in curve.columns[1:]
        },
    )


def curve_of(run: Run) -> pd.DataFrame:
    """Return the curve in at most CURVE_POINTS windows: last step of each, PSNR and loss over it."""
    windows = np.array_split(np.arange(len(run.losses)), min(CURVE_POINTS, len(run.losses)))
    return pd.DataFrame(
        {
            "step": [int(w[-1]) + 1 for w in windows],
            "train_psnr": [psnr([run.errors[i] for i in w]) for w in windows],
            "train_loss": [float(np.mean([run.losses[i] for i in w])) for w in windows],
        }
    )


def psnr(errors: list[float]) -> float:
    """Return the PSNR in dB of a mean over squared errors of colours in [0, 1]."""
    return float(-10 * np.log10(max(np.mean(errors), 1e-10)))
