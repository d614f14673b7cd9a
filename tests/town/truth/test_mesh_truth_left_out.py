"""The mesh is laid over the town by the photographs that were kept, whichever were left out before."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aug3d_core.geometry.views import Views
from aug3d_core.town.config import MeshTruthConfig
from aug3d_core.town.files import TRUTH_POSES
from aug3d_core.town.truth.mesh_truth_stage import run
from tests.engines.test_mesh_truth import TRUE, cameras, write_inputs
from tests.town.truth.test_truth_stage import write_photographs


def test_a_perfect_mesh_is_perfect_though_photographs_were_left_out(tmp_path: Path) -> None:
    found = cameras()
    inputs = write_inputs(tmp_path, found, TRUE)
    left_out = np.array([0, 0, 3])  # the town took these views twice, and the first ones were not kept
    taken = found.take(np.concatenate([left_out, np.arange(len(found))]))
    replace(taken, photo_id=np.arange(len(taken))).save(inputs["town"] / TRUTH_POSES)
    write_photographs(inputs["town"], inputs["sfm"], range(len(taken)), range(len(left_out), len(taken)))
    (tmp_path / "out").mkdir()
    figures = run(inputs, MeshTruthConfig(), tmp_path / "out", lambda *_: None).metrics
    assert figures["fscore_half_pct"] == 1
    assert figures["accuracy_median_m"] == pytest.approx(0, abs=1e-3)
    assert len(Views.load(inputs["town"] / TRUTH_POSES)) == len(found) + 3
