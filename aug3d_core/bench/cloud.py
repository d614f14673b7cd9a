"""The points of the town that `aug3d export --format points` writes, against its truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aug3d_core.bench.figure import Figure, at_most
from aug3d_core.depth.files import BASELINE_FUSED
from aug3d_core.geometry.fused import Fused
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.views import Views
from aug3d_core.sfm.files import VIEWS
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say, directly, run_trial
from aug3d_core.town.files import TRUTH_MESH
from aug3d_core.town.truth.pose_errors import extent_m, true_from_found
from aug3d_core.town.truth.true_views import true_views

_FAR = 0.005  # of the flight's extent, as for the mesh


def figures(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Return how many points there are, and how far they are from the true surface."""
    trial = run_trial(store, "depth", scene, (), directly(store, say))
    if trial.failure:
        return {"town_points": Figure(None, "", None, None, trial.failure)}
    return off_truth(*(store.files_dir(trial.records[name]) for name in ("town", "sfm", "depth")))


def off_truth(town: Path, sfm: Path, depth: Path) -> dict[str, Figure]:
    """Compare the points with the truth, after the similarity that maps the found cameras to the true ones."""
    fused = Fused.load(depth / BASELINE_FUSED)
    found, truth, mesh = Views.load(sfm / VIEWS), true_views(town, sfm), Mesh.load(town / TRUTH_MESH)
    off_m = Raycaster(mesh.xyz, mesh.triangles).distance(true_from_found(found, truth).apply(fused.xyz.astype(float)))
    return {
        "town_points": Figure(len(off_m), ""),
        "town_points_off": Figure(float(np.median(off_m)), "m"),
        "town_points_far_share": at_most(0.02, float((off_m > _FAR * extent_m(truth)).mean()), ""),
    }
