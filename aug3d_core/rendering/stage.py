"""Render every planned view of the mesh, shard by shard; shards that a killed run left behind are kept."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pandas as pd

from aug3d_core.errors import InputError
from aug3d_core.rendering.config import RenderingConfig
from aug3d_core.rendering.job import MeshFile, RenderJob
from aug3d_core.rendering.launch import render
from aug3d_core.rendering.sheet import save_sheet
from aug3d_core.stage import Inputs, Outcome, Progress
from aug3d_core.store import layout

_SHEET = "renders.png"
_SHEET_VIEWS = 48
_BLACK = 3.0  # mean luminance, of 255, below which a view shows nothing


def run(inputs: Inputs, config: RenderingConfig, out: Path, progress: Progress) -> Outcome:
    """Render the views of the sampling stage and judge each of them."""
    cameras_file = inputs["sampling"] / layout.CAMERAS
    with np.load(cameras_file, allow_pickle=False) as file:
        cameras = {name: file[name] for name in ("view_id", "dome_id", "size")}
    _check(cameras)
    shards = out / layout.SHARDS
    shards.mkdir(parents=True, exist_ok=True)
    jobs = _jobs(_mesh(inputs["surface"]), cameras_file, len(cameras["view_id"]), config, shards)
    speed = _render_missing(jobs, progress)
    table = pd.concat([_judge(i, job, cameras["dome_id"], config) for i, job in enumerate(jobs)], ignore_index=True)
    table.to_parquet(out / layout.RENDER_TABLE)
    save_sheet(_some_views(table, jobs), out / _SHEET)
    return _outcome(table, speed)


def _check(cameras: dict[str, np.ndarray]) -> None:
    if len(cameras["view_id"]) == 0:
        raise InputError(
            "the sampling stage planned no views", "Give it more cells, or photographs that cover more ground."
        )
    if len(np.unique(cameras["size"], axis=0)) > 1:
        raise InputError("the planned views differ in size", "Plan all views at the data set's one size.")


def _mesh(surface: Path) -> MeshFile:
    """Return the mesh of train photos, with its texture if it has one."""
    if (surface / layout.TEXTURED_MESH).exists():
        return MeshFile(path=surface / layout.TEXTURED_MESH, texture=surface / layout.MESH_TEXTURE)
    return MeshFile(path=surface / layout.MESH)


def _jobs(mesh: MeshFile, cameras: Path, views: int, config: RenderingConfig, shards: Path) -> list[RenderJob]:
    return [
        RenderJob(
            meshes=(mesh,),
            cameras=cameras,
            first=first,
            last=min(first + config.views_per_shard, views),
            out=shards / layout.shard_name(shard),
            samples=config.samples,
        )
        for shard, first in enumerate(range(0, views, config.views_per_shard))
    ]


def _render_missing(jobs: list[RenderJob], progress: Progress) -> float | None:
    """Render the shards that are not there; return views per minute, None when all were there."""
    total, rendered, start = jobs[-1].last, 0, time.monotonic()
    for job in jobs:
        if not job.out.exists():
            render(job, lambda done, job=job: progress(job.first + done, total, "views rendered"))
            rendered += job.last - job.first
        progress(job.last, total, "views rendered")
    return 60 * rendered / (time.monotonic() - start) if rendered else None


def _judge(shard: int, job: RenderJob, dome_id: np.ndarray, config: RenderingConfig) -> pd.DataFrame:
    with np.load(job.out, allow_pickle=False) as file:
        view_id, rgb, alpha = file["view_id"], file["rgb"], file["alpha"]
    cover = alpha / 255.0
    weight = np.maximum(cover.sum(axis=(1, 2)), 1e-6)
    luminance = np.einsum("nhwc,c,nhw->n", rgb, [0.2126, 0.7152, 0.0722], cover) / weight
    covered = cover.mean(axis=(1, 2))
    reason = np.where(
        covered < config.min_covered_share, "too little surface", np.where(luminance < _BLACK, "black", "")
    )
    return pd.DataFrame(
        {
            "view_id": view_id,
            "dome_id": dome_id[job.first : job.last],
            "shard": shard,
            "row": np.arange(len(view_id)),
            "kept": reason == "",
            "reason": reason,
            "covered_share": covered,
            "mean_luminance": luminance,
        }
    )


def _some_views(table: pd.DataFrame, jobs: list[RenderJob]) -> list[np.ndarray]:
    """Return kept views spread evenly over the plan."""
    kept = table[table["kept"]]
    chosen = kept.iloc[np.unique(np.linspace(0, len(kept) - 1, min(len(kept), _SHEET_VIEWS)).astype(int))]
    images = []
    for shard, rows in chosen.groupby("shard"):
        with np.load(jobs[int(shard)].out, allow_pickle=False) as file:
            images.extend(file["rgb"][rows["row"]])
    return images


def _outcome(table: pd.DataFrame, views_per_minute: float | None) -> Outcome:
    kept = int(np.count_nonzero(table["kept"]))
    if kept == 0:
        raise InputError(
            f"none of the {len(table)} rendered views shows enough surface",
            "Lower rendering.min_covered_share, or bring the domes closer to the surface.",
        )
    counts = {
        f"dropped_{r.replace(' ', '_')}": int(np.count_nonzero(table["reason"] == r))
        for r in ("too little surface", "black")
    }
    metrics = {"views": len(table), "kept": kept, "kept_share": kept / len(table), "views_per_minute": views_per_minute}
    return Outcome(metrics=metrics | counts, pictures={"Rendered views": _SHEET})
