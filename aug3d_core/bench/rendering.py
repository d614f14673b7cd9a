"""Rendering of the town's mesh: how fast, how much of the time is not Cycles' own, and what plain ray casting would cost.

1,000 views are asked for, as a data set's are: small, from cameras that the sampling stage planned.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from aug3d_core.bench.figure import Figure, at_least, at_most
from aug3d_core.bench.raycasting import raycast_figures
from aug3d_core.bench.render_speed import draw_speeds, many_views, speeds
from aug3d_core.domes.files import CAMERAS
from aug3d_core.rendering.config import RenderingConfig
from aug3d_core.rendering.files import SHARDS
from aug3d_core.rendering.given import read_cameras
from aug3d_core.rendering.stage import run
from aug3d_core.run.stage import Outcome
from aug3d_core.store import layout
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say, directly, run_trial

VIEWS, SIZE = 1000, (128, 96)
SPEED_PICTURE = "rendering_speed.png"


def figures(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Render the town's mesh with Cycles and by ray casting, and chart the speed of Cycles."""
    trial = run_trial(store, "sampling", scene, (), directly(store, say))
    if trial.failure or not trial.metric("sampling", "views_planned"):
        return {"render_views_per_minute": Figure(None, "1/min", 200.0, False, trial.failure or "no view was planned")}
    surface, sampling = (store.files_dir(trial.records[name]) for name in ("surface", "sampling"))
    pictures = store.root / layout.BENCH_PICTURES
    pictures.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=store.root) as folder:
        cameras = many_views(read_cameras(sampling / CAMERAS), VIEWS, SIZE)
        found, samples = cycles_figures(surface, cameras, Path(folder), say)
        found |= raycast_figures(surface, cameras, Path(folder) / SHARDS, say)
        told = speeds(surface, cameras, samples, Path(folder), say)
    draw_speeds(told, pictures / SPEED_PICTURE)
    return found


def cycles_figures(surface: Path, cameras: dict[str, np.ndarray], out: Path, say: Say) -> tuple[dict[str, Figure], int]:
    """Run the rendering stage on the views; return its figures and the samples that it chose.

    The speed is that of the whole stage, with the choice of samples and the judging of views. The overhead is the share of the
    worker processes' wall time, from start to end, that Cycles does not report as tracing: Python, loading bpy and the mesh,
    building the tree, handing the scene over, and files.
    """
    np.savez(out / CAMERAS, **cameras)  # type: ignore[arg-type]
    start = time.monotonic()
    done = run(
        {"surface": surface, "sampling": out},
        RenderingConfig(min_covered_share=0.0),
        out,
        lambda *progress: say("rendering", *progress),
    )
    per_minute = 60 * len(cameras["view_id"]) / (time.monotonic() - start)
    return {
        "render_views_per_minute": at_least(200.0, per_minute, "1/min"),
        "render_overhead_share": at_most(0.10, _number(done, "overhead_share"), "share"),
        "worker_growth_mib": at_most(300.0, _number(done, "worker_growth_mib"), "MiB"),
        "render_samples": Figure(_number(done, "samples"), "samples"),
        "render_samples_psnr_db": at_least(38.0, _number(done, "samples_psnr_db"), "dB"),
    }, int(_number(done, "samples") or 1)


def _number(outcome: Outcome, name: str) -> float | None:
    value = outcome.metrics[name]
    return None if value is None else float(value)
