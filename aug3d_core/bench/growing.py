"""What a tenth more photographs costs a finished town, over starting anew, and what that does to its accuracy."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np

from aug3d_core.bench.figure import Figure, at_least, at_most, told
from aug3d_core.bench.scale import town_of
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.views import Views
from aug3d_core.sfm.files import VIEWS
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say, Trial, directly, run_trial
from aug3d_core.surface.files import BASELINE_MESH
from aug3d_core.town.files import TOWN_PHOTOS, TRUTH_MESH, TRUTH_POSES
from aug3d_core.town.truth.mesh_errors import compare_meshes
from aug3d_core.town.truth.pose_errors import extent_m, pose_errors, true_from_found

PHOTOS = 250
UNTIL = "surface"
POSES = ("matching", "sfm")
_WITHIN = 0.005  # of the extent: distance of the F-score


def figures(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Add a tenth that is flown beside the others (`beside`), and one that is spread over the flight (`spread`)."""
    town = town_of(scene, PHOTOS)
    fresh = run_trial(store, UNTIL, town, (), directly(store, say))
    if fresh.failure:
        return {"town": Figure(None, "", None, None, fresh.failure)}
    photos = sorted((store.files_dir(fresh.records["town"]) / TOWN_PHOTOS).iterdir())
    truth = Views.load(store.file(fresh.records["town"], TRUTH_POSES))
    true_mesh = Mesh.load(store.file(fresh.records["town"], TRUTH_MESH))
    found = {"photographs": Figure(len(photos), "photographs")}
    for way, new in {"beside": photos[-round(len(photos) / 11) :], "spread": photos[5::11]}.items():
        aside = Store(store.root / f"growing_{way}")  # where no output of all photographs is known yet
        before, grown = _grown(aside, town, say, photos, new)
        if grown.failure:
            found[way] = Figure(None, "", None, False, grown.failure)
            continue
        poses = at_most(0.25, grown.cpu_seconds(POSES) / fresh.cpu_seconds(POSES), "share")
        ratio = _position_error(aside, grown, truth) / _position_error(store, fresh, truth)
        scores = [_fscore(*made, truth, true_mesh) for made in ((aside, grown), (store, fresh))]
        found |= {
            f"{way}_cost_matching_and_sfm": poses,
            **{f"{way}_cost_{stage}": _cost(grown, fresh, stage) for stage in ("depth", "surface")},
            f"{way}_poses_kept": Figure(told(grown, "sfm", "poses_kept"), "photographs"),
            f"{way}_test_kept": Figure(told(grown, "grouping", "test_kept"), "photographs"),
            f"{way}_maps_kept": Figure(told(grown, "depth", "photos_reused"), "photographs"),
            f"{way}_registered": at_least(1.0, told(grown, "sfm", "registered_share"), "share"),
            f"{way}_position_error": Figure(ratio, "times that anew"),
            f"{way}_mesh_fscore": Figure(scores[0] - scores[1], "share over that anew"),
            f"{way}_mesh_psnr": Figure(_mesh_psnr(grown) - _mesh_psnr(before), "dB over that before, same photographs"),
        }
    return found


def _grown(aside: Store, town: Measured, say: Say, photos: list[Path], new: list[Path]) -> list[Trial]:
    """Make a scene of all photographs but the new ones, then of all; return both."""
    folder = aside.root / "photos"
    shutil.rmtree(folder, ignore_errors=True)  # a benchmark that was killed may have left all photographs there
    folder.mkdir(parents=True)
    trials = []
    for added in (sorted(set(photos) - set(new)), new):
        for photo in added:
            shutil.copy(photo, folder)
        trials.append(run_trial(aside, UNTIL, town, (), directly(aside, say), folder))
    return trials


def _cost(grown: Trial, fresh: Trial, stage: str) -> Figure:
    return Figure(grown.cpu_seconds([stage]) / fresh.cpu_seconds([stage]), "share")


def _position_error(store: Store, trial: Trial, truth: Views) -> float:
    views = Views.load(store.file(trial.records["sfm"], VIEWS))
    return float(np.median(pose_errors(views, truth)["position_error_pct"]))


def _fscore(store: Store, trial: Trial, truth: Views, true_mesh: Mesh) -> float:
    """Return the F-score of the mesh, with its cameras laid over the true ones, at half a percent of the extent."""
    views = Views.load(store.file(trial.records["sfm"], VIEWS))
    mesh = Mesh.load(store.file(trial.records["surface"], BASELINE_MESH))
    mesh = replace(mesh, xyz=true_from_found(views, truth).apply(mesh.xyz.astype(float)))
    errors = compare_meshes(mesh, true_mesh, truth, np.random.default_rng(0))
    return errors.score(_WITHIN * extent_m(truth)).fscore


def _mesh_psnr(trial: Trial) -> float:
    """Return how well the mesh shows held-out photographs at full size [dB]."""
    return told(trial, "surface", "target_render_psnr_full") or float("nan")
