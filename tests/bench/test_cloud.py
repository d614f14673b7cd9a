"""Points that lie on the truth are not off; those that are moved are off by so much, wherever the scene's world is."""

import json
from pathlib import Path

import numpy as np
import pytest

from aug3d_core.bench.cloud import off_truth
from aug3d_core.geometry.fused import Fused
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.similarity import Similarity
from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Views
from aug3d_core.sfm.files import COMPONENTS

_UP_M = 0.25


def test_points_are_off_by_what_they_were_moved(tmp_path: Path) -> None:
    turned = Similarity(
        0.5, np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([3.0, 4.0, 5.0])
    )  # found_from_true
    at = np.array([(0.0, 0, 60), (40, 5, 60), (40, 45, 62), (2, 40, 65)])
    poses = np.stack([look_at(eye, eye * [1, 1, 0] + [0.1, 0, 0]) for eye in at])
    count = len(at)
    views = Views(np.arange(count), poses, np.tile([500.0, 500, 32, 24], (count, 1)), np.tile([64, 48], (count, 1)))
    found = Views(views.photo_id, turned.move_cameras(poses), views.intrinsics, views.size)
    ground = np.array([(-50.0, -50, 0), (90, -50, 0), (90, 90, 0), (-50, 90, 0)], np.float32)
    views.save(tmp_path / "poses.npz")
    found.save(tmp_path / "views.npz")
    Mesh(ground, np.zeros((4, 3), np.uint8), np.array([(0, 1, 2), (0, 2, 3)])).save(tmp_path / "mesh.ply")
    xyz = np.column_stack([np.random.default_rng(0).uniform(-20, 60, (1001, 2)), np.full(1001, _UP_M)])
    xyz[:101, 2] = 9.0
    fused = turned.apply(xyz).astype(np.float32)
    Fused(fused, fused, np.zeros((1001, 3), np.uint8), np.full(1001, 2, np.uint8)).save(tmp_path / "baseline_fused.npz")
    (tmp_path / "truth").mkdir()
    for name in ("poses.npz", "mesh.ply"):
        (tmp_path / name).rename(tmp_path / "truth" / name)
    (tmp_path / COMPONENTS).write_text(json.dumps({"photo_sha256": ["of one"] * count}))
    figures = off_truth(tmp_path, tmp_path, tmp_path)
    assert figures["town_points"].value == 1001
    assert figures["town_points_off"].value == pytest.approx(_UP_M, abs=1e-4)
    assert figures["town_points_far_share"].value == pytest.approx(101 / 1001)
    assert figures["town_points_far_share"].holds is False
