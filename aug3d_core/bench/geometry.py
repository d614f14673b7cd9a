"""Poses, depth and mesh of the town against its truth, and what each setting buys for its time."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from aug3d_core.bench.figure import Figure, at_least, at_most, told
from aug3d_core.bench.front import Point
from aug3d_core.bench.trial import Measured, Say, Trial, run_trial
from aug3d_core.geometry.views import Views
from aug3d_core.sfm.spread import spread_pct
from aug3d_core.store import layout
from aug3d_core.store.store import Store

POSES, MESH = ("matching", "sfm"), ("depth", "surface")
LOWER_IS_BETTER = frozenset({"position_error_pct"})


@dataclass(frozen=True)
class Setting:
    """One setting and the values to try; time is that of `stages`, accuracy the figure `figure` of `judge`."""

    name: str
    field: str
    values: tuple[str, ...]
    stages: tuple[str, ...]
    judge: str
    figure: str


_POSE_ERROR, _FSCORE, _PSNR = (
    ("truth", "position_error_pct"),
    ("mesh_truth", "fscore_half_pct"),
    ("mesh_truth", "mesh_render_psnr"),
)
SETTINGS = (
    Setting("features per photograph", "matching.max_features", ("1024", "2048", "4096", "8192"), POSES, *_POSE_ERROR),
    Setting("size of the photographs (px)", "photos.max_px", ("320", "480", "640"), POSES, *_POSE_ERROR),
    Setting("pair choice", "matching.pairs", ("exhaustive", "gps", "coarse"), POSES, *_POSE_ERROR),
    Setting("mapper", "sfm.mapper", ("incremental", "global", "hierarchical"), ("sfm",), *_POSE_ERROR),
    Setting("depth map width (px)", "depth.max_px", ("256", "384", "512", "640"), MESH, *_FSCORE),
    Setting("depth planes: step (px)", "depth.plane_step_px", ("0.5", "1", "2", "4"), MESH, *_FSCORE),
    Setting("triangles: error bound (GSD)", "surface.max_error_gsd", ("0.25", "0.5", "1", "2"), ("surface",), *_PSNR),
    Setting("texel (GSD)", "surface.texel_gsd", ("0.7", "1", "1.4", "2"), ("surface",), *_PSNR),
)


def town_figures(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Return how far the town's poses, depth and mesh are from its truth."""
    trial = run_trial(store, "mesh_truth", scene, (), say)
    if trial.failure:
        return {"town": Figure(None, "", None, None, trial.failure)}
    stages = [name for name in trial.records if name != "town"]
    return {
        "town_registered_share": at_least(1.0, told(trial, "truth", "registered_share"), "share"),
        "town_position_error_pct": at_most(0.1, told(trial, "truth", "position_error_pct"), "% of extent"),
        "town_rotation_error_deg": at_most(0.05, told(trial, "truth", "rotation_error_deg"), "degrees"),
        "town_fscore_half_pct": at_least(0.80, told(trial, "mesh_truth", "fscore_half_pct"), "share"),
        "town_fscore_one_pct": at_least(0.90, told(trial, "mesh_truth", "fscore_one_pct"), "share"),
        "town_mesh_render_psnr": at_least(22.0, told(trial, "mesh_truth", "mesh_render_psnr"), "dB"),
        "town_mesh_render_covered": at_least(0.95, told(trial, "mesh_truth", "mesh_render_covered"), "share"),
        "depth_seconds_per_photo": at_most(2.0, told(trial, "depth", "seconds_per_photo"), "s"),
        "town_reconstruction_seconds": Figure(trial.seconds(stages), "s"),
        "town_peak_mib": at_most(4096.0, trial.peak_mib(stages), "MiB"),
    }


def pairs_speedup(store: Store, scene: Measured, say: Say, photos: Path | None) -> dict[str, Figure]:
    """Return how much faster chosen pairs are than all pairs, at the same settings, and that no photograph is lost.

    Only the comparing counts (with the choosing); both need the same features. One run each.
    """
    chosen, full = (
        run_trial(store, "sfm", scene, (f"matching.pairs={way}",), say, photos) for way in ("coarse", "exhaustive")
    )
    seconds, full_seconds = (told(trial, "matching", "match_seconds") for trial in (chosen, full))
    registered, full_registered = (told(trial, "sfm", "registered") for trial in (chosen, full))
    if not seconds or not full_seconds or not registered or not full_registered:
        return {"pairs_speedup_over_exhaustive": Figure(None, "ratio", 3.0, False, chosen.failure or full.failure)}
    return {
        "pairs_speedup_over_exhaustive": at_least(3.0, full_seconds / seconds, "ratio"),
        "pairs_registered_over_exhaustive": at_least(1.0, registered / full_registered, "ratio"),
    }


def pose_spread(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Return how far the town's cameras are apart over seeds, and between incremental and global mapping."""
    ways = {"seeds": ("sfm.seed=0", "sfm.seed=1", "sfm.seed=2"), "mappers": ("sfm.seed=0", "sfm.mapper=global")}
    figures = {}
    for name, overrides in ways.items():
        trials = [run_trial(store, "sfm", scene, (override,), say) for override in overrides]
        runs = [Views.load(store.files_dir(t.records["sfm"]) / layout.VIEWS) for t in trials if "sfm" in t.records]
        value = spread_pct(runs) if len(runs) == len(trials) else None
        figures[f"town_pose_spread_{name}_pct"] = Figure(value, "% of extent")
    return figures


def growth(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Return what it costs to add every tenth photograph of the town to the others, over starting anew."""
    fresh = run_trial(store, "sfm", scene, (), say)
    photos = sorted((store.files_dir(fresh.records["town"]) / layout.TOWN_PHOTOS).iterdir())
    aside = Store(store.root / "growth")  # where no reconstruction of all photographs is known yet
    folder = aside.root / "photos"
    shutil.rmtree(folder, ignore_errors=True)  # a benchmark that was killed may have left all photographs there
    folder.mkdir()
    for number, photo in enumerate(photos):
        if number % 10:
            shutil.copy(photo, folder)
    run_trial(aside, "sfm", scene, (), say, folder)
    for photo in photos:
        shutil.copy(photo, folder)
    grown = run_trial(aside, "sfm", scene, (), say, folder)
    if "sfm" not in grown.records or "sfm" not in fresh.records:
        return {"growth_cost_share": Figure(None, "share", 0.25, False, grown.failure or fresh.failure)}
    return {
        "growth_cost_share": at_most(0.25, grown.seconds(POSES) / fresh.seconds(POSES), "share"),
        "growth_registered_share": at_least(
            1.0, float(len(Views.load(aside.files_dir(grown.records["sfm"]) / layout.VIEWS)) / len(photos)), "share"
        ),
    }


def sweep(store: Store, scene: Measured, say: Say) -> Iterator[Point]:
    """Yield a point for every value of every setting, the others at the preset's."""
    for setting in SETTINGS:
        stage, _, field = setting.field.partition(".")
        default = str(getattr(getattr(scene.config(), stage), field))
        for value in dict.fromkeys((*setting.values, default)):
            trial = run_trial(store, setting.judge, scene, (f"{setting.field}={value}",), say)
            yield _point(setting, value, value == default, trial)


def _point(setting: Setting, value: str, default: bool, trial: Trial) -> Point:
    return Point(
        setting=setting.name,
        value=value,
        default=default,
        seconds=trial.seconds(setting.stages),
        peak_mib=trial.peak_mib(setting.stages),
        accuracy=told(trial, setting.judge, setting.figure),
        accuracy_name=setting.figure,
        failure=trial.failure,
    )
