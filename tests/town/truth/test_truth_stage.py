import hashlib
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.similarity import Similarity
from aug3d_core.geometry.views import Views
from aug3d_core.sfm.files import COMPONENTS, VIEWS
from aug3d_core.town.config import TownConfig, TruthConfig
from aug3d_core.town.drone.flight import plan_flight
from aug3d_core.town.files import TOWN_PHOTOS, TOWN_TRUTH, TRUTH_MESH, TRUTH_POSES
from aug3d_core.town.stage import photo_name
from aug3d_core.town.truth.pose_errors import area_under_recall, footprint_ious, pair_errors_deg, pose_errors
from aug3d_core.town.truth.true_views import true_views
from aug3d_core.town.truth.truth_stage import run


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


def test_pairs_need_no_frame_and_lost_views_count(truth):
    elsewhere = moved(truth, Similarity(0.13, turned(70, 0), np.array([5.0, -7.0, 900.0])))
    assert pair_errors_deg(elsewhere, truth).max() < 1e-5
    half = pair_errors_deg(elsewhere.take(np.arange(0, len(truth), 2)), truth)
    n = len(truth)
    assert len(half) == n * (n - 1) / 2
    kept = (n + 1) // 2
    assert np.isfinite(half).sum() == kept * (kept - 1) / 2


def test_a_turned_view_is_wrong_in_all_its_pairs(truth):
    twisted = truth.cam_from_world.copy()
    twisted[7] = turned(0.25, 1) @ twisted[7]
    errors = pair_errors_deg(Views(truth.photo_id, twisted, truth.intrinsics, truth.size), truth)
    wrong = errors > 1e-5
    assert wrong.sum() == len(truth) - 1
    np.testing.assert_allclose(errors[wrong], 0.25, rtol=1e-6)


def test_area_under_recall_is_the_integral():
    errors = np.array([0.0, 0.25, 0.5, 2.0, np.inf])
    thresholds = (np.arange(10_000) + 0.5) / 10_000
    recall = (errors[:, None] <= thresholds).mean(axis=0)
    assert area_under_recall(errors, 1.0) == pytest.approx(recall.mean(), abs=1e-4)
    assert area_under_recall(np.empty(0), 1.0) == 0


def write_photographs(town: Path, sfm: Path, taken: Sequence[int], kept: Sequence[int]) -> None:
    """Write the town's photographs, and which of them structure from motion was given, as it tells them."""
    (town / TOWN_PHOTOS).mkdir()
    for number in taken:
        (town / TOWN_PHOTOS / photo_name(number)).write_bytes(b"%d" % number)
    sha256 = [hashlib.sha256(b"%d" % number).hexdigest() for number in kept]
    (sfm / COMPONENTS).write_text(json.dumps({"photo_sha256": sha256}))


def flat_ground(half_m: float = 300.0) -> Mesh:
    corners = half_m * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32)
    return Mesh(corners, np.full((4, 3), 100, np.uint8), np.array([(0, 1, 2), (0, 2, 3)], np.int32))


def test_footprints_shrink_with_the_focal_length(truth):
    longer = truth.intrinsics * [1.25, 1.25, 1, 1]
    ground, rng = flat_ground(150), np.random.default_rng(0)
    same = footprint_ious(truth, truth, ground, rng)
    np.testing.assert_array_equal(same, 1)
    narrow = footprint_ious(Views(truth.photo_id, truth.cam_from_world, longer, truth.size), truth, ground, rng)
    assert np.median(narrow) == pytest.approx(1 / 1.25**2, abs=0.02)


def stage(tmp_path: Path, found: Views, truth: Views, kept: Sequence[int] | None = None):
    """Run the stage. kept: which of the town's photographs the photos stage kept; all without."""
    folders = {name: tmp_path / name for name in ("town", "sfm", "out")}
    for folder in folders.values():
        folder.mkdir()
    (folders["town"] / TOWN_TRUTH).mkdir()
    truth.save(folders["town"] / TRUTH_POSES)
    flat_ground().save(folders["town"] / TRUTH_MESH)
    found.save(folders["sfm"] / VIEWS)
    taken = range(len(truth))
    write_photographs(folders["town"], folders["sfm"], taken, taken if kept is None else kept)
    return run(folders, TruthConfig(), folders["out"], lambda *_: None)


def test_the_stage_counts_what_is_missing(truth, tmp_path):
    outcome = stage(tmp_path, truth.take(np.arange(0, len(truth), 2)), truth)
    assert outcome.metrics["registered_share"] == 0.5
    assert outcome.metrics["position_error_pct"] == pytest.approx(0, abs=1e-6)
    assert outcome.metrics["footprint_iou"] == 1
    assert outcome.metrics["pose_auc_one_deg"] == pytest.approx(0.25, abs=0.01), "three of four pairs lack a view"


def test_photographs_that_were_left_out_are_no_errors_and_shift_no_other(truth, tmp_path):
    kept = np.arange(2, len(truth), 3)
    renumbered = replace(truth.take(kept), photo_id=np.arange(len(kept)))
    outcome = stage(tmp_path, renumbered, truth, kept.tolist())
    assert outcome.metrics["registered_share"] == 1
    assert outcome.metrics["position_error_pct_max"] == pytest.approx(0, abs=1e-6)
    assert outcome.metrics["rotation_error_deg_max"] == pytest.approx(0, abs=1e-5)
    assert outcome.metrics["footprint_iou_min"] == 1
    assert outcome.metrics["pose_auc_half_deg"] == pytest.approx(1, abs=1e-4)


def test_photograph_10000_was_taken_after_9999(tmp_path):
    town, sfm = tmp_path / "town", tmp_path / "sfm"
    (town / TOWN_TRUTH).mkdir(parents=True)
    sfm.mkdir()
    truth = plan_flight(TownConfig(), np.random.default_rng(0)).take(np.arange(4))
    truth.save(town / TRUTH_POSES)
    write_photographs(town, sfm, range(9_998, 10_002), [9_999, 10_000, 10_001])
    views = true_views(town, sfm)
    assert views.photo_id.tolist() == [0, 1, 2]
    np.testing.assert_array_equal(views.cam_from_world, truth.cam_from_world[1:])


def test_too_few_poses_degrade(truth, tmp_path):
    outcome = stage(tmp_path, truth.take(np.arange(2)), truth)
    assert outcome.state == "degraded" and "2 photographs" in outcome.notes[0]
