"""True overlap where it is known: level ground, a wall in between, backs turned, holes; and the stage that tells it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Views
from aug3d_core.groups import similarity_stage, stage
from aug3d_core.groups.config import GroupingConfig, SimilarityConfig
from aug3d_core.groups.files import GROUPS
from aug3d_core.groups.methods import METHODS
from aug3d_core.overlap import stage as overlap_stage
from aug3d_core.overlap.config import OverlapConfig
from aug3d_core.overlap.files import OVERLAP_MEMBERS, OVERLAP_TABLE
from aug3d_core.overlap.true_overlap import NET, seen_places, true_overlaps
from aug3d_core.photos.files import image_name
from aug3d_core.run.errors import InputError
from aug3d_core.run.stage import Outcome
from aug3d_core.sfm.files import COMPONENTS, VIEW_IMAGES
from aug3d_core.surface.files import BASELINE_MESH
from aug3d_core.town.files import TOWN_PHOTOS, TOWN_TRUTH, TRUTH_MESH, TRUTH_POSES
from aug3d_core.town.truth import overlap_stage as town_stage
from aug3d_core.town.truth.patchwork import block, ground, patchwork
from tests.groups.strip_scene import fly, write_sfm
from tests.same_files import assert_same_files

RNG = np.random.default_rng(0)
FIELD = patchwork([ground(400, 100)], RNG)
WALLED = patchwork([ground(200, 200), *block((0.0, 0.0), (300.0, 2.0, 60.0))], RNG)


def square(eyes: list[tuple[float, float, float]], targets: list[tuple[float, float, float]]) -> Views:
    """Return cameras that see 80 m of ground in each direction from 60 m straight above."""
    poses = np.stack([look_at(np.array(e, float), np.array(t, float)) for e, t in zip(eyes, targets, strict=True)])
    n = len(poses)
    return Views(np.arange(n), poses, np.tile([90.0, 90.0, 60.0, 60.0], (n, 1)), np.full((n, 2), 120))


def overlap(views: Views, mesh: Mesh) -> float:
    surface = Raycaster(mesh.xyz, mesh.triangles)
    return float(true_overlaps(views, surface, np.array([[0, 1]])).value[0])


@pytest.mark.parametrize("away", [0.0, 20.0, 40.0, 72.0, 90.0])
def test_two_footprints_on_level_ground_overlap_as_squares_do(away: float) -> None:
    views = square([(0, 0, 60), (away, 0, 60)], [(0, 0, 0), (away, 0, 0)])
    assert overlap(views, FIELD) == pytest.approx(max(0.0, 1 - away / 80), abs=1 / NET[0])


def test_a_closer_look_counts_as_the_mean_of_both_directions() -> None:
    views = square([(0, 0, 60), (0, 0, 30)], [(0, 0, 0), (0, 0, 0)])
    assert overlap(views, FIELD) == pytest.approx((1 + 1 / 4) / 2, abs=1 / NET[0])


def test_a_wall_hides_what_is_behind_it() -> None:
    eyes, same_spot = [(0.0, -40.0, 40.0), (0.0, 40.0, 40.0)], [(0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
    assert overlap(square(eyes, same_spot), patchwork([ground(200, 200)], RNG)) > 0.3
    assert overlap(square(eyes, same_spot), WALLED) < 0.02


def test_backs_turned_see_nothing_alike_though_both_see_the_ground() -> None:
    views = square([(0, 0, 30), (0, 0, 30)], [(60, 0, 0), (-60, 0, 0)])
    assert overlap(views, FIELD) == 0.0


def test_a_view_that_meets_too_little_of_the_mesh_is_not_judged() -> None:
    views = square([(0, 0, 60), (0, 0, 60), (10, 0, 60)], [(0, 0, 0), (0, 0, 120), (10, 0, 0)])
    surface = Raycaster(FIELD.xyz, FIELD.triangles)
    assert len(seen_places(views, surface, 1)) == 0
    values = true_overlaps(views, surface, np.array([[0, 1], [2, 1], [0, 2]]))
    assert np.isnan(values.of(np.array([0, 1]), np.array([1, 2]))).all()
    assert values.of(np.array([2]), np.array([0]))[0] > 0.8


def test_pairs_may_come_in_any_order_and_often_and_few_are_asked_for() -> None:
    views = square([(x, 0, 60) for x in (0, 20, 40, 60)], [(x, 0, 0) for x in (0, 20, 40, 60)])
    surface = Raycaster(FIELD.xyz, FIELD.triangles)
    values = true_overlaps(views, surface, np.array([[3, 1], [1, 3], [1, 3]]))
    assert len(values.key) == 1
    assert values.of(np.array([1]), np.array([3])) == pytest.approx(0.5, abs=1 / NET[0])
    assert len(true_overlaps(views, surface, np.empty((0, 2), int)).value) == 0


def silent(done: int, total: int, what: str) -> None: ...


def inputs_of_strip(folder: Path, k: int, photos: int = 40, length_m: float = 400.0) -> dict[str, Path]:
    """Write what earlier stages would have made of the strip, with pictures, the mesh and the truth."""
    inputs = {name: folder / name for name in ("sfm", "similarity", "grouping", "surface", "town")}
    for path in (*inputs.values(), inputs["sfm"] / VIEW_IMAGES, inputs["town"] / TOWN_TRUTH):
        path.mkdir(parents=True)
    flight = fly(photos, length_m=length_m)
    write_sfm(inputs["sfm"], flight)
    views, _, _ = flight
    views.save(inputs["town"] / TRUTH_POSES)
    for photo_id in views.photo_id:
        image = Image.new("RGB", (120, 120), (int(photo_id), 90, 90))
        image.save(inputs["sfm"] / VIEW_IMAGES / image_name(int(photo_id)))
    FIELD.save(inputs["surface"] / BASELINE_MESH)
    FIELD.save(inputs["town"] / TRUTH_MESH)
    similarity_stage.run(inputs, SimilarityConfig(), inputs["similarity"], silent)
    stage.run(inputs, GroupingConfig(k=k), inputs["grouping"], silent)
    return inputs


def run_stage(folder: Path, inputs: dict[str, Path]) -> Outcome:
    folder.mkdir()
    return overlap_stage.run(inputs, OverlapConfig(groups=12), folder, silent)


def test_the_stage_tells_every_way_at_every_size(tmp_path: Path) -> None:
    inputs = inputs_of_strip(tmp_path / "in", 6)
    outcome = run_stage(tmp_path / "out", inputs)
    table = pd.read_parquet(tmp_path / "out" / OVERLAP_TABLE)
    assert {("shared", 6), ("shared", 10), ("shared", 20), ("best", 10)} <= set(
        zip(table["method"], table["k"], strict=True)
    )
    assert set(METHODS) <= set(table["method"])
    assert outcome.state == "ok" and outcome.metrics["bad_members_share"] == 0.0
    assert outcome.metrics["k"] == 6
    members = pd.read_parquet(tmp_path / "out" / OVERLAP_MEMBERS)
    mine = members[(members["method"] == "shared") & (members["k"] == 10)]
    assert outcome.metrics["bad_members_shared_k10"] == pytest.approx((mine["overlap"] < 0.1).mean())
    shares = table.set_index(["method", "k"])["bad_members_share"]
    assert all(shares["best", k] <= shares["shared", k] for k in (10, 20))
    for picture in outcome.pictures.values():
        with Image.open(tmp_path / "out" / picture) as image:
            assert image.width > 300
    again = run_stage(tmp_path / "again", inputs)
    assert again == outcome
    assert_same_files(tmp_path / "out", tmp_path / "again")


def test_the_town_is_measured_at_true_poses_though_photographs_were_left_out_and_others_not_placed(
    tmp_path: Path,
) -> None:
    inputs = inputs_of_strip(tmp_path / "in", 6)
    placed, first = (
        Views.load(inputs["town"] / TRUTH_POSES),
        2,
    )  # that was kept: the town's numbers are ahead by as many
    kept = int(placed.photo_id.max()) + 1
    taken_of = np.zeros(first + kept, int)
    taken_of[placed.photo_id + first] = np.arange(len(placed))
    replace(placed.take(taken_of), photo_id=np.arange(first + kept)).save(inputs["town"] / TRUTH_POSES)
    photographs = [b"%d" % number for number in range(first + kept)]
    (inputs["town"] / TOWN_PHOTOS).mkdir()
    for number, photograph in enumerate(photographs):
        (inputs["town"] / TOWN_PHOTOS / f"{number:04d}.jpg").write_bytes(photograph)
    sha256 = [hashlib.sha256(photograph).hexdigest() for photograph in photographs[first:]]
    (inputs["sfm"] / COMPONENTS).write_text(json.dumps({"photo_sha256": sha256}))
    (tmp_path / "town").mkdir()
    exact = town_stage.run(inputs, OverlapConfig(groups=12), tmp_path / "town", silent)
    assert exact.metrics == run_stage(tmp_path / "mesh", inputs).metrics


def test_groups_of_views_that_see_nothing_alike_are_degraded(tmp_path: Path) -> None:
    inputs = inputs_of_strip(tmp_path / "in", 6)
    with np.load(inputs["grouping"] / GROUPS) as arrays:
        test_members = arrays["test_members"]
    np.savez(inputs["grouping"] / GROUPS, members=np.array([[0, 10, 29, 11]]), test_members=test_members)
    outcome = run_stage(tmp_path / "out", inputs)
    assert outcome.state == "degraded"
    assert "of the members of the scene's groups see next to nothing" in outcome.notes[0]


def test_a_mesh_of_a_corner_judges_few_members_and_says_so(tmp_path: Path) -> None:
    inputs = inputs_of_strip(tmp_path / "in", 6)
    corner = patchwork([ground(40, 40)], RNG)
    corner.save(inputs["surface"] / BASELINE_MESH)
    outcome = run_stage(tmp_path / "out", inputs)
    assert outcome.state == "degraded"
    assert outcome.notes[0].startswith("the mesh shows too little to judge")


def test_a_way_that_cannot_group_the_views_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise InputError("no ray meets the ground", "Set grouping.method to shared.")

    monkeypatch.setitem(METHODS, "ray", refuse)
    outcome = run_stage(tmp_path / "out", inputs_of_strip(tmp_path / "in", 6))
    assert outcome.state == "ok" and outcome.metrics["bad_members_ray_k10"] is None
    assert "ray makes no groups of 10: no ray meets the ground" in outcome.notes


def test_six_photographs_are_measured_at_the_only_size_there_is(tmp_path: Path) -> None:
    inputs = inputs_of_strip(tmp_path / "in", 2, 6, 100.0)
    outcome = run_stage(tmp_path / "out", inputs)
    table = pd.read_parquet(tmp_path / "out" / OVERLAP_TABLE)
    assert set(table.loc[table["method"] != "test", "k"]) == {2}
    assert outcome.metrics["bad_members_shared_k10"] is None
    assert len(outcome.pictures) == 2


def test_an_empty_mesh_is_refused(tmp_path: Path) -> None:
    inputs = inputs_of_strip(tmp_path / "in", 6)
    empty = Mesh(np.empty((0, 3), np.float32), np.empty((0, 3), np.uint8), np.empty((0, 3), np.int32))
    empty.save(inputs["surface"] / BASELINE_MESH)
    with pytest.raises(InputError, match="no triangle"):
        run_stage(tmp_path / "out", inputs)
