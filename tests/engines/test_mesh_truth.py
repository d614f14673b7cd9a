"""Mesh truth on meshes whose errors are known: two floors and a wall seen by a square of cameras."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.similarity import Similarity
from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Views
from aug3d_core.photos.files import image_name
from aug3d_core.sfm.files import COMPONENTS, VIEW_IMAGES, VIEWS
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.surface.files import BASELINE_MESH, BASELINE_RENDERS
from aug3d_core.town.config import MeshTruthConfig
from aug3d_core.town.files import TOWN_TRUTH, TRUTH_MESH, TRUTH_POSES
from aug3d_core.town.truth.mesh_errors import MeshErrors, compare_meshes
from aug3d_core.town.truth.mesh_truth_stage import run

SIDE = 100.0


def floor(x0: float, x1: float, z: float) -> tuple[np.ndarray, np.ndarray]:
    corners = np.array([(x0, 0, z), (x1, 0, z), (x1, SIDE, z), (x0, SIDE, z)], np.float32)
    return corners, np.array([(0, 1, 2), (0, 2, 3)], np.int32)


def mesh(*parts: tuple[np.ndarray, np.ndarray]) -> Mesh:
    xyz = np.concatenate([p[0] for p in parts])
    triangles = np.concatenate([p[1] + 4 * i for i, p in enumerate(parts)])
    return Mesh(xyz, np.full((len(xyz), 3), 128, np.uint8), triangles)


def cameras() -> Views:
    at = [np.array([x, y, 60.0]) for x in (20.0, 50.0, 80.0) for y in (20.0, 50.0, 80.0)]
    poses = np.stack([look_at(a, a * [1, 1, 0]) for a in at])
    n = len(at)
    return Views(np.arange(n), poses, np.tile([50.0, 50.0, 50.0, 50.0], (n, 1)), np.tile([100, 100], (n, 1)))


TRUE = mesh(floor(0, SIDE, 0.0))


def errors(found: Mesh, true: Mesh = TRUE) -> MeshErrors:
    return compare_meshes(found, true, cameras(), np.random.default_rng(0), samples=20_000)


def test_the_true_mesh_itself_has_no_error():
    same = errors(TRUE)
    assert same.score(1e-3).fscore == 1
    assert len(same.true_xyz) > 15_000


def test_a_shifted_plane_fails_below_the_shift_and_passes_above():
    shifted = errors(mesh(floor(0, SIDE, 0.75)))
    assert shifted.score(0.5).fscore == 0
    assert shifted.score(1.0).fscore == 1
    np.testing.assert_allclose(shifted.found_off_m, 0.75, atol=1e-4)


def test_half_a_mesh_is_accurate_and_half_complete():
    score = errors(mesh(floor(0, SIDE / 2, 0.0))).score(0.01)
    assert score.accuracy == 1
    assert score.completeness == pytest.approx(0.5, abs=0.02)
    assert score.fscore == pytest.approx(2 / 3, abs=0.02)


def test_an_invented_floor_beneath_costs_accuracy_alone():
    score = errors(mesh(floor(0, SIDE, 0.0), floor(0, SIDE, -5.0))).score(1.0)
    assert score.completeness == 1
    assert score.accuracy == pytest.approx(0.5, abs=0.05)


def test_what_no_two_photographs_see_is_not_asked_for():
    cellar = mesh(floor(0, SIDE, 0.0), floor(0, SIDE, -5.0))
    seen = errors(TRUE, cellar)
    assert np.allclose(seen.true_xyz[:, 2], 0), "the upper floor hides the lower"
    assert seen.score(0.01).fscore == 1


def test_what_lies_beyond_the_photographs_is_not_judged():
    afar = errors(mesh(floor(0, SIDE, 0.0), floor(900, 900 + SIDE, 40.0)))
    assert afar.score(0.01).fscore == 1


def test_nothing_at_all_scores_nothing():
    nothing = Mesh(np.empty((0, 3), np.float32), np.empty((0, 3), np.uint8), np.empty((0, 3), np.int32))
    assert errors(nothing).score(5.0).fscore == 0


def write_inputs(folder: Path, found: Views, baseline: Mesh) -> dict[str, Path]:
    inputs = {name: folder / name for name in ("town", "sfm", "grouping", "surface")}
    for path in (inputs["town"] / TOWN_TRUTH, inputs["sfm"] / VIEW_IMAGES, inputs["grouping"]):
        path.mkdir(parents=True)
    (inputs["surface"] / BASELINE_RENDERS).mkdir(parents=True)
    cameras().save(inputs["town"] / TRUTH_POSES)
    TRUE.save(inputs["town"] / TRUTH_MESH)
    found.save(inputs["sfm"] / VIEWS)
    every = [str(photo_id) for photo_id in cameras().photo_id]  # none was left out
    (inputs["sfm"] / COMPONENTS).write_text(json.dumps({"photo_sha256": every}))
    role = ["target" if i == 4 else "train" for i in range(len(found))]
    table = {"view": range(len(found)), "photo_id": found.photo_id, "role": role}
    pd.DataFrame(table).to_parquet(inputs["grouping"] / SPLIT_TABLE)
    baseline.save(inputs["surface"] / BASELINE_MESH)
    name = image_name(4)
    Image.new("RGB", (100, 100), (100, 100, 100)).save(inputs["sfm"] / VIEW_IMAGES / name)
    render = Image.new("RGBA", (100, 100), (100, 100, 100 + 51, 255))  # a fifth too blue: 10 log10(3 * 25) dB
    render.paste((0, 0, 0, 0), (0, 0, 100, 25))
    render.save(inputs["surface"] / BASELINE_RENDERS / name)
    return inputs


def measure(tmp_path: Path, found: Views, baseline: Mesh):
    out = tmp_path / "out"
    out.mkdir()
    return run(write_inputs(tmp_path, found, baseline), MeshTruthConfig(), out, lambda *_: None), out


def test_the_stage_finds_the_mesh_in_any_frame(tmp_path):
    """The reconstruction, in a frame of its own, is 0.6 % of the extent too high."""
    turn = np.array([(0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
    found_from_true = Similarity(0.2, turn, np.array([3.0, 4.0, 5.0]))
    true = cameras()
    found = replace(true, cam_from_world=found_from_true.move_cameras(true.cam_from_world))
    high = mesh(floor(0, SIDE, 0.006 * 60 * np.sqrt(2)))
    high = replace(high, xyz=found_from_true.apply(high.xyz.astype(float)).astype(np.float32))
    outcome, out = measure(tmp_path, found, high)
    assert outcome.state == "ok"
    assert outcome.metrics["extent_m"] == pytest.approx(60 * np.sqrt(2))
    assert outcome.metrics["fscore_half_pct"] == 0
    assert outcome.metrics["fscore_one_pct"] == 1
    assert outcome.metrics["mesh_render_psnr"] == pytest.approx(10 * np.log10(75), abs=1e-6)
    assert outcome.metrics["mesh_render_covered"] == 0.75
    for picture in outcome.pictures.values():
        assert (out / picture).exists()


def test_too_few_poses_degrade_but_renders_are_still_compared(tmp_path):
    true = cameras()
    outcome, _ = measure(tmp_path, true.take(np.array([0, 4])), TRUE)
    assert outcome.state == "degraded" and "2 photographs" in outcome.notes[0]
    assert "fscore_half_pct" not in outcome.metrics


def test_a_mesh_elsewhere_is_degraded_with_a_score_of_nothing(tmp_path):
    outcome, _ = measure(tmp_path, cameras(), mesh(floor(900, 1000, 0.0)))
    assert outcome.state == "degraded" and "no part of the mesh" in outcome.notes[0]
    assert outcome.metrics["fscore_one_pct"] == 0
