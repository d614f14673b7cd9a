"""The stage `prediction`: dataset + model -> a view that no photograph shows. No run makes it; `aug3d predict` does."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from jaxtyping import UInt8

from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.on_disk import Cache
from aug3d_core.dataset.reader import read
from aug3d_core.dataset.scene import SPLITS
from aug3d_core.heads import saved
from aug3d_core.heads.head import View
from aug3d_core.judging import panels
from aug3d_core.judging.scores import psnr, ssim
from aug3d_core.novel.config import PredictionConfig
from aug3d_core.novel.files import PREDICTION, PREDICTION_DEPTH, PREDICTION_PANEL, PREDICTION_VIEW
from aug3d_core.novel.outside import outside_scene
from aug3d_core.novel.views import NovelView, novel_view, row_of
from aug3d_core.run.stage import Metric, Outcome, Progress

LITTLE_SEEN = 0.5  # share of the view's ground that inputs show, below which the prediction is mostly made up


def run(inputs: Mapping[str, Path], config: PredictionConfig, out: Path, progress: Progress) -> Outcome:
    """Predict one view, and write it with its depth, a panel of what it was made from, and its camera."""
    scene = read(inputs["dataset"] / SCENE_ZARR, Cache())
    if "given" in inputs:  # photographs from outside
        scene = outside_scene(inputs["given"], scene)
    head = saved.load(inputs["training"])
    torch.set_num_threads(len(os.sched_getaffinity(0)))
    view = novel_view(scene, config)
    progress(0, 1, "view")
    predicted = head.predict_bare(view.scene, view.target, view.inputs)
    progress(1, 1, "view")
    truth = None if config.like is None else row_of(view.scene, config.like)
    panels.save(_with_alpha(predicted), out / PREDICTION)
    if predicted.depth is not None:
        panels.save(panels.depth_colours(predicted.depth), out / PREDICTION_DEPTH)
    panels.save(panels.novel_panel(view.scene, view.inputs, predicted, truth), out / PREDICTION_PANEL)
    (out / PREDICTION_VIEW).write_text(json.dumps(_described(view), indent=1))
    notes = _notes(view, config) + _like_notes(view, config)
    return Outcome(
        metrics={"head": head.config.name, **_metrics(view, predicted, truth)},
        state="degraded" if view.ground_seen_share < LITTLE_SEEN else "ok",
        notes=notes,
        pictures={"Inputs, prediction, depth": PREDICTION_PANEL},
    )


def _with_alpha(view: View) -> UInt8[np.ndarray, "h w c"]:
    """Mark what no input sees as transparent; the colours are kept."""
    if view.seen is None:
        return view.colour
    return np.dstack([view.colour, np.where(view.seen, 255, 0).astype(np.uint8)])


def _metrics(view: NovelView, predicted: View, truth: int | None) -> dict[str, Metric]:
    figures = {"ground_seen_share": view.ground_seen_share}
    if predicted.seen is not None:
        figures |= {"seen_share": float(predicted.seen.mean())}
    if predicted.depth is not None:
        near, far = np.quantile(predicted.depth, [0.01, 0.99])
        figures |= {"depth_near": float(near), "depth_far": float(far)}
    if truth is not None:
        compared = (view.scene.images[truth], predicted.colour, view.scene.used(truth))
        figures |= {"psnr": psnr(*compared), "ssim": ssim(*compared)}
    return {"inputs": len(view.inputs), **{name: round(value, 4) for name, value in figures.items()}}


def _described(view: NovelView) -> dict[str, object]:
    """Return the inputs and the camera, in the conventions of the data set."""
    return {
        "inputs": view.scene.photo_id[view.inputs].tolist(),
        "world_from_cam": view.scene.world_from_cam[view.target].tolist(),
        "intrinsics": view.scene.intrinsics[view.target].tolist(),
        "size_px": [view.scene.width_px, view.scene.height_px],
    }


def _notes(view: NovelView, config: PredictionConfig) -> tuple[str, ...]:
    notes = []
    if len(view.inputs) < config.input_views:
        notes.append(
            f"the view is predicted from {len(view.inputs)} inputs; the model was judged with {config.input_views}"
        )
    if view.ground_seen_share < LITTLE_SEEN:
        notes.append(f"the inputs show only {view.ground_seen_share:.0%} of the ground in view; the rest is made up")
    return tuple(notes)


def _like_notes(view: NovelView, config: PredictionConfig) -> tuple[str, ...]:
    if config.like is None:
        return ()
    row = row_of(view.scene, config.like)
    split = SPLITS[view.scene.splits[row]]
    if split == "train":
        return (f"the model was trained with photo {config.like}: this is no test of it",)
    if split != "target" and view.scene.scaffold[row].any():
        return (f"the mesh that the model starts from was made with photo {config.like}: this is no test of it",)
    return ()
