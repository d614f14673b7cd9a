"""The stage `preview`: photographs with poses + a trained model -> views and a flight, before anything else is made.

The model may be of another place. How good it is here is measured: some photographs are predicted from the others, and where
that is not surely better than an answer without learning, the stage warns before anyone looks at a view.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from aug3d_core.dataset.new_views import with_views
from aug3d_core.dataset.photographs import scene_of_photographs
from aug3d_core.dataset.scene import Scene
from aug3d_core.heads import saved
from aug3d_core.heads.head import Head, View
from aug3d_core.judging import panels, video
from aug3d_core.judging.cheap_answers import ground_homography
from aug3d_core.judging.scores import psnr
from aug3d_core.judging.summary import interval
from aug3d_core.judging.warped_answers import plane_sweep
from aug3d_core.novel.config import PreviewConfig
from aug3d_core.novel.files import PREVIEW_FLIGHT, PREVIEW_SHEET, PREVIEW_VIEWS
from aug3d_core.novel.inputs import inputs_of
from aug3d_core.run.errors import InputError
from aug3d_core.run.stage import Outcome, Progress

CHEAP = {"homography": ground_homography, "plane sweep": plane_sweep}  # answers from the same inputs, without learning
FRAMES_PER_SECOND = 8
_ACROSS = (0.1, 0.9)  # quantiles of the cameras along their longest line, between which the flight goes


def run(inputs: Mapping[str, Path], config: PreviewConfig, out: Path, progress: Progress) -> Outcome:
    """Predict some photographs from the others, and a flight across all of them."""
    scene = scene_of_photographs(inputs["sfm"], (config.width_px, config.height_px))
    if len(scene) <= config.input_views:
        raise InputError(
            f"{len(scene)} photographs have a pose, and {config.input_views} and one more are needed",
            "give more photographs that overlap",
        )
    head = saved.load(inputs["training"])
    torch.set_num_threads(len(os.sched_getaffinity(0)))
    chosen = np.unique(np.linspace(0, len(scene) - 1, config.views + 2).round().astype(int)[1:-1])
    total = len(chosen) + config.frames
    (out / PREVIEW_VIEWS).mkdir(exist_ok=True)
    rows, scores = [], []
    for done, target in enumerate(chosen):
        progress(done, total, "photographs from the others")
        given = inputs_of(scene, int(target), np.delete(np.arange(len(scene)), target), config.input_views)
        view = head.predict(scene, int(target), given)
        answers = [view.colour, *(answer(scene, int(target), given) for answer in CHEAP.values())]
        truth = scene.images[target]
        scores.append([psnr(truth, answer, scene.used(int(target))) for answer in answers])
        name = f"photo_{scene.photo_id[target]:06d}.png"
        panels.save(view.colour, out / PREVIEW_VIEWS / name)
        rows.append(
            [
                (f"photo {scene.photo_id[target]}", panels.photograph(scene, int(target))),
                (f"prediction {scores[-1][0]:.1f} dB", view.colour),
                *_depth(view),
                *(
                    (f"{name} {db:.1f} dB", answer)
                    for name, db, answer in zip(CHEAP, scores[-1][1:], answers[1:], strict=True)
                ),
            ]
        )
    panels.save(panels.grid(rows), out / PREVIEW_SHEET)
    seen = _fly(head, scene, config, out, lambda frame: progress(len(chosen) + frame, total, "flight"))
    progress(total, total, "done")
    figures = foreseen(np.array(scores))
    doubts = doubts_of(figures)
    return Outcome(
        metrics={
            "head": head.config.name,
            "photographs": len(scene),
            **figures,
            "flight_seen_share": round(seen, 4),
        },
        state="degraded" if doubts else "ok",
        notes=("each of these photographs was predicted without itself; its neighbours were there", *doubts),
        pictures={"Photographs predicted from the others": PREVIEW_SHEET, "Flight": PREVIEW_FLIGHT},
    )


def foreseen(scores: Float[np.ndarray, "t 3"]) -> dict[str, float]:
    """Return what the scores [dB] of the model, the homography and the sweep say of views that no photograph shows.

    The lead is over the better of the two, paired over photographs, with the lower end of its 95 % interval.
    """
    model, *cheap = scores.mean(axis=0)
    lead = scores[:, 0] - scores[:, 1 + int(np.argmax(cheap))]
    low, _ = interval(lead) or (min(0.0, float(lead[0])), 0.0)  # one photograph says nothing surely
    figures = {
        "preview_psnr": model,
        "cheap_homography": cheap[0],
        "cheap_plane_sweep": cheap[1],
        "over_homography_db": model - cheap[0],
        "over_best_cheap_db": lead.mean(),
        "over_best_cheap_low_db": low,
    }
    return {name: round(float(value), 3) for name, value in figures.items()}


def doubts_of(figures: Mapping[str, float]) -> list[str]:
    """Warn where the model is not surely better than an answer without learning."""
    if figures["over_best_cheap_low_db"] > 0:
        return []
    return [
        f"the model may be no better here than an answer without learning ({figures['over_best_cheap_db']:+.2f} dB over the"
        f" better one, at least {figures['over_best_cheap_low_db']:+.2f}): poses or photographs may be poor, or the place is"
        " unlike those that it was trained on"
    ]


def across(scene: Scene, frames: int) -> Float[np.ndarray, "f 4 4"]:
    """Return the poses of a straight flight along the longest line through the cameras, all looking one usual way."""
    eyes = scene.world_from_cam[:, :3, 3]
    middle = np.median(eyes, axis=0)
    line = np.linalg.svd(eyes[:, :2] - middle[:2], full_matrices=False)[2][0]
    along = (eyes[:, :2] - middle[:2]) @ line
    height = np.median(scene.slab.height(eyes))
    usual = usual_rotation(scene)
    poses = np.tile(np.eye(4), (frames, 1, 1))
    first, last = np.quantile(along, _ACROSS)
    for pose, at in zip(poses, np.linspace(first, last, frames), strict=True):
        x, y = middle[:2] + at * line
        z = scene.slab.a * x + scene.slab.b * y + scene.slab.c + height
        pose[:3, :3], pose[:3, 3] = usual, (x, y, z)
    return poses


def usual_rotation(scene: Scene) -> Float[np.ndarray, "3 3"]:
    """Return the rotation of the camera that is turned least against all others."""
    turns = Rotation.from_matrix(scene.world_from_cam[:, :3, :3])
    apart = [np.median((turn.inv() * turns).magnitude()) for turn in turns]
    return scene.world_from_cam[int(np.argmin(apart)), :3, :3]


def _fly(head: Head, scene: Scene, config: PreviewConfig, out: Path, report: Callable[[int], None]) -> float:
    if not config.frames:
        return 0.0
    intrinsics = np.median(scene.intrinsics, axis=0)
    wider, frames = with_views(scene, across(scene, config.frames), intrinsics, np.arange(len(scene)))
    shown, seen = [], []
    for number, frame in enumerate(frames):
        report(number)
        view = head.predict(wider, int(frame), inputs_of(wider, int(frame), np.arange(len(scene)), config.input_views))
        shown.append(view.colour)
        seen.append(1.0 if view.seen is None else float(view.seen.mean()))
    video.save(shown, out / PREVIEW_FLIGHT, FRAMES_PER_SECOND)
    return float(np.mean(seen))


def _depth(view: View) -> list[tuple[str, np.ndarray]]:
    return [] if view.depth is None else [("its depth", panels.depth_colours(view.depth))]
