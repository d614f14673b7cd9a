"""Render every planned view of the mesh, shard by shard. Shards of a killed run are reused."""

from __future__ import annotations

import itertools
import os
import time
from pathlib import Path

import numpy as np
import pandas as pd

from aug3d_core.domes.files import CAMERAS
from aug3d_core.rendering.config import RenderingConfig
from aug3d_core.rendering.decisions import decision
from aug3d_core.rendering.files import RENDER_TABLE, SHARDS, shard_name
from aug3d_core.rendering.given import find_mesh, read_cameras
from aug3d_core.rendering.job import Emission, RenderJob, Shard, Sunlit
from aug3d_core.rendering.launch import Spent, drop_leftovers, render
from aug3d_core.rendering.probe import ENOUGH_DB, Chosen, choose_samples
from aug3d_core.rendering.quality import REASONS, figures, reasons
from aug3d_core.rendering.sheet import save_sheet
from aug3d_core.run.errors import InputError
from aug3d_core.run.scratch import scratch_folder
from aug3d_core.run.stage import Inputs, Metric, Outcome, Progress, from_elsewhere

_SHEET = "renders.png"
_SHEET_VIEWS = 48
# Small views use only one thread, so several workers use the cores better; but each holds the mesh in memory.
_MOST_WORKERS = 4


def run(inputs: Inputs, config: RenderingConfig, out: Path, progress: Progress) -> Outcome:
    """Render the views of the sampling stage and judge each of them."""
    cameras = read_cameras(inputs["sampling"] / CAMERAS)
    shards = out / SHARDS
    shards.mkdir(parents=True, exist_ok=True)
    total = len(cameras["view_id"])
    if not total:
        _table([], cameras, config).to_parquet(out / RENDER_TABLE)
        return Outcome(
            metrics={"views": 0, "kept": 0, "kept_share": None},
            notes=("no views were planned: the data set contains photographs only",),
        )
    job, chosen = _planned(inputs, config, cameras, shards, progress)
    planned, start = job.shards, time.monotonic()
    spent = _render(job, total, progress)
    seconds = time.monotonic() - start
    table = _table(list(planned), cameras, config)
    table.to_parquet(out / RENDER_TABLE)
    save_sheet(_some_views(table, planned), out / _SHEET)
    return _outcome(table, chosen, spent, seconds)


def assist(inputs: Inputs, config: RenderingConfig, out: Path, progress: Progress) -> Outcome:
    """Render views that are not there yet."""
    cameras = read_cameras(inputs["sampling"] / CAMERAS)
    if not len(cameras["view_id"]):
        return Outcome(metrics={"views": 0})
    (out / SHARDS).mkdir(parents=True, exist_ok=True)
    job, _ = _planned(inputs, config, cameras, out / SHARDS, progress)
    job = job.model_copy(update={"shards": tuple(from_elsewhere(job.shards))})
    return Outcome(metrics={"views": _render(job, len(cameras["view_id"]), progress).views})


def _planned(
    inputs: Inputs, config: RenderingConfig, cameras: dict[str, np.ndarray], shards: Path, progress: Progress
) -> tuple[RenderJob, Chosen]:
    job = RenderJob(
        meshes=(find_mesh(inputs["surface"]),),
        cameras=inputs["sampling"] / CAMERAS,
        shards=(),
        light=_light(config),
    )
    chosen = _samples(config, job, cameras, shards, progress)
    planned = _shards(len(cameras["view_id"]), config.views_per_shard, chosen.samples, shards)
    return job.model_copy(update={"shards": planned}), chosen


def _light(config: RenderingConfig) -> Emission | Sunlit:
    if config.light == "emission":
        return Emission()
    return Sunlit(sun_azimuth_deg=config.sun_azimuth_deg, sun_elevation_deg=config.sun_elevation_deg).exposed()


def _samples(
    config: RenderingConfig, job: RenderJob, cameras: dict[str, np.ndarray], shards: Path, progress: Progress
) -> Chosen:
    if config.samples != "auto":
        return Chosen(config.samples, None, "set by hand")
    progress(0, 1, "choosing samples on a few views")
    with scratch_folder(shards / "probe") as scratch:
        return choose_samples(job, cameras, scratch)


def _shards(views: int, most: int, samples: int, folder: Path) -> tuple[Shard, ...]:
    """Divide the plan into shards of equal size, independent of the number of cores."""
    ends = np.linspace(0, views, -(-views // most) + 1).astype(int).tolist()
    return tuple(
        Shard(first=first, last=last, out=folder / shard_name(shard), samples=samples)
        for shard, (first, last) in enumerate(itertools.pairwise(ends))
    )


def _render(job: RenderJob, total: int, progress: Progress) -> Spent:
    """Render the missing shards."""
    drop_leftovers(job.shards)
    there = sum(shard.last - shard.first for shard in job.shards if shard.out.exists())
    cores = len(os.sched_getaffinity(0))
    workers = min(cores, _MOST_WORKERS, len(job.shards))
    job = job.model_copy(update={"threads": cores // workers})
    progress(there, total, "views rendered")
    return render(job, lambda done: progress(there + done, total, "views rendered"), workers)


def _table(shards: list[Shard], cameras: dict[str, np.ndarray], config: RenderingConfig) -> pd.DataFrame:
    """Return one row per view: its shard, its figures, and whether it is kept."""
    nothing = np.zeros((0, 1, 1, 3), np.uint8)
    told = [_figures(shard.out) for shard in shards] or [figures(nothing, nothing[..., 0])]
    quality = {name: np.concatenate([part[name] for part in told]) for name in told[0]}
    reason = reasons(quality, config.min_covered_share)
    sizes = [shard.last - shard.first for shard in shards]
    return pd.DataFrame(
        {
            "view_id": cameras["view_id"],
            "dome_id": cameras["dome_id"],
            "shard": np.repeat(np.arange(len(shards)), sizes),
            "row": np.concatenate([np.arange(size) for size in sizes] or [np.arange(0)]),
            "kept": reason == "",
            "reason": reason,
            **quality,
        }
    )


def _figures(shard: Path) -> dict[str, np.ndarray]:
    with np.load(shard, allow_pickle=False) as file:
        return figures(file["rgb"], file["alpha"])


def _some_views(table: pd.DataFrame, shards: tuple[Shard, ...]) -> list[np.ndarray]:
    """Return kept views spread evenly over the plan."""
    kept = table[table["kept"]]
    chosen = kept.iloc[np.unique(np.linspace(0, len(kept) - 1, min(len(kept), _SHEET_VIEWS)).astype(int))]
    images = []
    for shard, rows in chosen.groupby("shard"):
        with np.load(shards[int(shard)].out, allow_pickle=False) as file:
            images.extend(file["rgb"][rows["row"]])
    return images


def _outcome(table: pd.DataFrame, chosen: Chosen, spent: Spent, seconds: float) -> Outcome:
    kept = int(np.count_nonzero(table["kept"]))
    if kept == 0:
        raise InputError(
            f"none of the {len(table)} rendered views shows enough surface",
            "Lower rendering.min_covered_share, or bring the domes closer to the surface.",
        )
    metrics: dict[str, Metric] = {
        "views": len(table),
        "kept": kept,
        "kept_share": kept / len(table),
        "samples": chosen.samples,
        "samples_psnr_db": chosen.psnr_db,
        "samples_reason": chosen.reason,
        "views_per_minute": 60 * spent.views / seconds if spent.views else None,
        "overhead_share": spent.overhead_share,
        "worker_growth_mib": spent.growth_mib if spent.views else None,
        "sharpness_median": float(np.median(table["sharpness"])),
    }
    dropped = {f"dropped_{r.replace(' ', '_')}": int(np.count_nonzero(table["reason"] == r)) for r in REASONS}
    coarse = chosen.psnr_db is not None and chosen.psnr_db < ENOUGH_DB
    return Outcome(
        metrics=metrics | dropped,
        state="degraded" if coarse else "ok",
        notes=(chosen.reason,) if coarse else (),
        pictures={"Rendered views": _SHEET},
        decisions=(decision(chosen),),
    )
