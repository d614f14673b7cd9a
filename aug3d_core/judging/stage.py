"""The stage `evaluation`: dataset + model -> scores on held-out photographs, beside the cheap answers."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch

from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.on_disk import Cache
from aug3d_core.dataset.reader import read
from aug3d_core.dataset.scene import Scene
from aug3d_core.geometry.masks import save_mask
from aug3d_core.heads import saved
from aug3d_core.heads.head import Head
from aug3d_core.judging import flythrough, panels, video
from aug3d_core.judging.cheap_answers import cheap_answers
from aug3d_core.judging.config import EvaluationConfig
from aug3d_core.judging.conventions import conventions, digest, held_out_digest
from aug3d_core.judging.files import (
    COMPARED,
    CONVENTIONS,
    FLYTHROUGH,
    PANELS,
    TEST_VIEWS,
    mask_of,
    prediction_of,
    truth_of,
)
from aug3d_core.judging.names import called, ends_of
from aug3d_core.judging.scores import Judged, evaluate
from aug3d_core.judging.summary import CHEAP, summary
from aug3d_core.photos.files import image_name
from aug3d_core.run.stage import Outcome, Progress

SUMMARY = "summary.png"


def run(inputs: Mapping[str, Path], config: EvaluationConfig, out: Path, progress: Progress) -> Outcome:
    """Score the model on every test view, and draw panels of some."""
    scene = read(inputs["dataset"] / SCENE_ZARR, Cache())
    head = saved.load(inputs["training"])
    torch.set_num_threads(len(os.sched_getaffinity(0)))
    count = len(scene.groups["test"])
    kept: dict[int, Judged] = {}

    def seen(group: int, judged: Judged) -> None:
        kept[group] = judged
        progress(group + 1, count, "test views")

    progress(0, count, "test views")
    table = evaluate(head, scene, config, seen)
    table.to_parquet(out / TEST_VIEWS, index=False)
    stated = conventions(scene)
    (out / CONVENTIONS).write_text(json.dumps(stated, indent=1))
    figures = summary(table)
    started_from = ", ".join(sorted({one.view.started_from for one in kept.values() if one.view.started_from}))
    unbeaten = [name for name in CHEAP if (figures[f"over_{name}_ci_low"] or 0) <= 0]
    pictures = _draw(scene, config, table, kept, out) if config.panels else {}
    if config.flythrough_frames:
        progress(count, count, "fly-through")
        pictures |= _fly(head, scene, config, table, kept, out)
    return Outcome(
        metrics={
            "head": head.config.name,
            **({"started_from": started_from} if started_from else {}),
            "seconds_per_view": round(float(np.median([one.seconds for one in kept.values()])), 3),
            **figures,
            "conventions": digest(stated),
            "test_photos": held_out_digest(scene),
        },
        # Worse than one colour: whatever the training did well, what is rendered is wrong
        state="degraded" if np.mean(table["psnr"]) <= np.mean(table["mean_colour_psnr"]) else "ok",
        notes=(*_fewer(scene, config), *(_not_beaten(name, figures) for name in unbeaten)),
        pictures=pictures,
    )


def _fewer(scene: Scene, config: EvaluationConfig) -> list[str]:
    support = scene.groups["test"].shape[1] - 1
    told = f"a test group has {support} support views: every answer was given {support}, not {config.input_views}"
    return [told] if support < config.input_views else []


def _not_beaten(name: str, figures: Mapping[str, Any]) -> str:
    ends = ends_of(figures, f"over_{name}")
    why = f"the 95 % interval of the difference is {ends[0]:+.2f} to {ends[1]:+.2f} dB" if ends else "one test view"
    return (
        f"the model ({figures['test_psnr_mean']:.2f} dB) does not beat {called(name)}"
        f" ({figures[f'cheap_{name}']:.2f} dB), as far as this test can tell: {why}"
    )


def _fly(
    head: Head, scene: Scene, config: EvaluationConfig, table: pd.DataFrame, kept: Mapping[int, Judged], out: Path
) -> dict[str, str]:
    """Fly around the test view that is met middlingly, so that the flight flatters nobody."""
    ranked = table.sort_values(["psnr", "group"])
    row = ranked.iloc[(len(ranked) - 1) // 2]
    judged = kept[int(row["group"])]
    frames = flythrough.fly(head, scene, judged.target, judged.inputs, config)
    video.save(frames, out / FLYTHROUGH, flythrough.FRAMES_PER_SECOND)
    return {f"Flight around photo {row['photo_id']:.0f} ({row['psnr']:.1f} dB, the middle one)": FLYTHROUGH}


def _draw(
    scene: Scene,
    config: EvaluationConfig,
    table: pd.DataFrame,
    kept: Mapping[int, Judged],
    out: Path,
) -> dict[str, str]:
    """Draw panels evenly from the best to the worst view; return their captions and paths."""
    for folder in (PANELS, COMPARED):
        (out / folder).mkdir(exist_ok=True)
    ranked = table.sort_values(["psnr", "group"], ascending=[False, True])
    chosen = ranked.iloc[np.unique(np.linspace(0, len(ranked) - 1, config.panels).round().astype(int))]
    pictures, shown = {"Test views, best first": f"{PANELS}/{SUMMARY}"}, []
    for row in chosen.to_dict("records"):
        judged = kept[row["group"]]
        answers = cheap_answers(scene, judged.target, judged.inputs)
        one = (judged.target, judged.inputs, judged.view, answers, row)
        photo = image_name(int(row["photo_id"]))
        name = f"{PANELS}/{photo}"
        panels.save(panels.panel(scene, *one), out / name)
        panels.save(judged.view.colour, out / prediction_of(photo))
        panels.save(panels.photograph(scene, judged.target), out / truth_of(photo))
        if (used := scene.used(judged.target)) is not None:
            save_mask(used, out / mask_of(photo))
        pictures[f"Photo {row['photo_id']}: {row['psnr']:.1f} dB"] = name
        shown.append(one)
    panels.save(panels.summary_panel(scene, shown), out / PANELS / SUMMARY)
    return pictures
