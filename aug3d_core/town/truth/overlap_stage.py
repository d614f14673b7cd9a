"""The overlap stage on the true town: exact overlaps of the true views, for groups made of what was reconstructed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aug3d_core.geometry.ply import Mesh
from aug3d_core.groups.read_scene import read_scene
from aug3d_core.overlap.config import OverlapConfig
from aug3d_core.overlap.stage import measure_groups
from aug3d_core.run.stage import Inputs, Outcome, Progress
from aug3d_core.town.files import TRUTH_MESH
from aug3d_core.town.truth.true_views import true_views


def run(inputs: Inputs, config: OverlapConfig, out: Path, progress: Progress) -> Outcome:
    """Measure every way of grouping on the true mesh, seen from the true poses of the photographs that were placed."""
    scene = read_scene(inputs)
    truth = true_views(inputs["town"], inputs["sfm"])
    eyes = truth.take(np.searchsorted(truth.photo_id, scene.views.photo_id))
    mesh = Mesh.load(inputs["town"] / TRUTH_MESH)
    return measure_groups(scene, eyes, mesh, inputs, config, out, progress)
