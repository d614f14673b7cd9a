from pathlib import Path

import numpy as np
import pytest

from aug3d_core.geometry.similarity import Similarity
from aug3d_core.geometry.views import Views
from aug3d_core.store import layout
from aug3d_core.testbed.config import TownConfig, TruthConfig
from aug3d_core.testbed.flight import plan_flight
from aug3d_core.testbed.truth_stage import pose_errors, run


@pytest.fixture
def truth() -> Views:
    return plan_flight(TownConfig(), np.random.default_rng(0))


def moved(views: Views, by: Similarity) -> Views:
    return Views(views.photo_id, by.move_cameras(views.cam_from_world), views.intrinsics, views.size)


def turned(angle_deg: float, axis: int = 2) -> np.ndarray:
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    rotation = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    rotation[i, i] = rotation[j, j] = c
    rotation[i, j], rotation[j, i] = -s, s
    return rotation


def test_another_frame_and_scale_is_no_error(truth):
    elsewhere = moved(truth, Similarity(0.13, turned(70, 0) @ turned(-130), np.array([5.0, -7.0, 900.0])))
    errors = pose_errors(elsewhere.take(np.arange(3, 50)), truth)
    assert errors["photo_id"].tolist() == list(range(3, 50))
    np.testing.assert_allclose(errors["position_error_pct"], 0, atol=1e-6)
    np.testing.assert_allclose(errors["rotation_error_deg"], 0, atol=1e-5)


def test_known_errors_are_found(truth):
    twisted = truth.cam_from_world.copy()
    twisted[7] = turned(0.25, 1) @ twisted[7]  # about the camera's own centre
    found = Views(truth.photo_id, twisted, truth.intrinsics, truth.size)
    errors = pose_errors(found, truth)
    assert errors["rotation_error_deg"][7] == pytest.approx(0.25, rel=1e-6)
    assert errors["rotation_error_deg"].median() == pytest.approx(0, abs=1e-6)
    np.testing.assert_allclose(errors["position_error_pct"], 0, atol=1e-6)


def stage(tmp_path: Path, found: Views, truth: Views):
    folders = {name: tmp_path / name for name in ("town", "sfm", "out")}
    for folder in folders.values():
        folder.mkdir()
    (folders["town"] / layout.TOWN_TRUTH).mkdir()
    truth.save(folders["town"] / layout.TRUTH_POSES)
    found.save(folders["sfm"] / layout.VIEWS)
    return run(folders, TruthConfig(), folders["out"], lambda *_: None)


def test_the_stage_counts_what_is_missing(truth, tmp_path):
    outcome = stage(tmp_path, truth.take(np.arange(0, len(truth), 2)), truth)
    assert outcome.metrics["registered_share"] == 0.5
    assert outcome.metrics["position_error_pct"] == pytest.approx(0, abs=1e-6)


def test_too_few_poses_degrade(truth, tmp_path):
    outcome = stage(tmp_path, truth.take(np.arange(2)), truth)
    assert outcome.state == "degraded" and "2 photographs" in outcome.notes[0]
