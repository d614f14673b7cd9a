"""The sfm stage with each mapper, with focal lengths that lie, and grown from an earlier output."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pycolmap
import pytest

from aug3d_core.geometry.similarity import fit_similarity
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Views
from aug3d_core.photos.files import read_photos
from aug3d_core.run.files import EARLIER
from aug3d_core.sfm import export
from aug3d_core.sfm.files import COMPONENTS, FALLOFF, FEATURES
from aug3d_core.sfm.grow import Earlier, find_earlier
from aug3d_core.sfm.hold import adjust_some, why_all_move
from aug3d_core.sfm.mapping import choose_mapper, parts_of
from tests.engines.little_scene import FOCAL_PX, poses, write_flight
from tests.engines.sfm_runs import loaded, run_sfm, run_stage, take_photos

pytestmark = pytest.mark.slow

FLIGHT = poses(4, 4)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with 16 photographs, `photos`, their `matching`, and an earlier sfm output of the first 14, `earlier`."""
    folder = tmp_path_factory.mktemp("flown")
    photos = take_photos(write_flight(folder / "in", FLIGHT, noise_m=0.2), folder / "photos")
    run_stage("matching", folder / "matching", {"photos": photos})
    for late in (14, 15):
        (folder / "in" / f"photo_{late}.jpg").unlink()
    before = run_sfm(take_photos(folder / "in", folder / "photos_before"), folder / "before")
    assert before["metrics"]["registered"] == 14
    (folder / "earlier").mkdir()
    (folder / "earlier" / "00").symlink_to(folder / "before" / "files")
    return folder


def place(flown: Path, folder: Path, earlier: Path | None = None, **config: Any) -> dict[str, Any]:
    """Run the sfm stage over the 16 photographs; return its outcome."""
    inputs = {"photos": flown / "photos", "matching": flown / "matching" / "files"}
    return run_stage("sfm", folder, inputs | ({EARLIER: earlier} if earlier else {}), **config)


def worst_m(sfm: Path) -> float:
    """Return the largest error of a camera centre after the similarity that best maps them to the truth."""
    views, _, _ = loaded(sfm)
    true = centres(FLIGHT[views.photo_id])
    fit = fit_similarity(centres(views.cam_from_world), true)
    return float(np.linalg.norm(fit.apply(centres(views.cam_from_world)) - true, axis=1).max())


def test_new_photographs_are_added_to_the_earlier_model(flown: Path, tmp_path: Path) -> None:
    outcome = place(flown, tmp_path / "sfm", flown / "earlier")
    metrics = outcome["metrics"]
    assert (metrics["grown_from"], metrics["registered"]) == (14, 16)
    assert metrics["focal_source"] == "exif"
    assert outcome["state"] == "ok"
    assert metrics["reprojection_px"] < 0.6
    assert worst_m(tmp_path / "sfm") < 0.15  # 0.3 % of the height, as when computed anew
    was, now = (folder / FALLOFF for folder in (flown / "before" / "files", tmp_path / "sfm" / "files"))
    assert now.read_bytes() == was.read_bytes(), "the lens is as it was"


def test_earlier_photographs_stay_where_they_were_to_the_bit(flown: Path, tmp_path: Path) -> None:
    outcome = place(flown, tmp_path / "sfm", flown / "earlier")
    assert outcome["metrics"]["poses_kept"] == 14
    assert {"sfm.poses": "14 kept as they were"}.items() <= {
        one["field"]: one["value"] for one in outcome["decisions"]
    }.items()
    was, now = loaded(flown / "before"), loaded(tmp_path / "sfm")
    assert np.array_equal(now[0].cam_from_world[:14], was[0].cam_from_world)
    assert np.array_equal(now[0].intrinsics[:14], was[0].intrinsics)
    there = {xyz.tobytes() for xyz in was[1].xyz}
    stayed = np.array([xyz.tobytes() in there for xyz in now[1].xyz])
    seen_by_new = np.isin(np.arange(len(stayed)), now[2].point[now[2].view >= 14])
    assert not stayed[seen_by_new].any()
    assert stayed[~seen_by_new].all()
    components = json.loads((tmp_path / "sfm" / "files" / COMPONENTS).read_bytes())
    assert components["settled"] == 14, "or many small steps would add up to a scene that rests on its smallest part"
    (tmp_path / "next").mkdir()
    (tmp_path / "next" / "00").symlink_to(tmp_path / "sfm" / "files")
    photos = read_photos(flown / "photos")
    more = pd.concat([photos, photos.tail(1).assign(photo_id=16, sha256="new")])
    following = find_earlier(more, flown / "matching" / "files" / FEATURES, tmp_path / "next")
    assert following is not None and following.settled == 14
    world_was, world_now = (
        json.loads((sfm / "files" / "world.json").read_bytes()) for sfm in (flown / "before", tmp_path / "sfm")
    )
    assert world_now["origin"] == world_was["origin"]
    assert world_now["gps_residual_m_median"] < 0.3


def test_earlier_photographs_move_where_new_ones_contradict_them(flown: Path, tmp_path: Path) -> None:
    earlier = tmp_path / "earlier" / "00"
    shutil.copytree(flown / "before" / "files", earlier)
    model = pycolmap.Reconstruction(earlier / "model")
    for image in export.registered(model):  # a bowl, as deep as a hundredth of the flight's height
        pose = image.cam_from_world()
        centre = image.projection_center()
        bent = centre + np.array([0, 0, 5e-4 * (centre[0] ** 2 + centre[1] ** 2)])
        model.frame(image.frame_id).rig_from_world = pycolmap.Rigid3d(pose.rotation, -pose.rotation.matrix() @ bent)
    model.write_binary(earlier / "model")
    views = Views.load(earlier / "views.npz")
    replace(views, cam_from_world=export.poses(model)).save(earlier / "views.npz")
    outcome = place(flown, tmp_path / "sfm", tmp_path / "earlier")
    assert (outcome["metrics"]["grown_from"], outcome["metrics"]["poses_kept"]) == (14, 0)
    assert worst_m(tmp_path / "sfm") < 0.15


def test_a_lens_that_could_not_be_told_before_is_measured_when_the_scene_has_grown(flown: Path, tmp_path: Path) -> None:
    earlier = tmp_path / "earlier" / "00"
    shutil.copytree(flown / "before" / "files", earlier)
    assert json.loads((earlier / FALLOFF).read_text()).keys() == {"1"}
    (earlier / FALLOFF).write_text(json.dumps({"1": None}))
    metrics = place(flown, tmp_path / "sfm", tmp_path / "earlier")["metrics"]
    assert metrics["poses_kept"] == 14 and metrics["corner_light"] is not None


def test_some_photographs_and_what_they_see_are_adjusted_and_nothing_else(flown: Path) -> None:
    model = pycolmap.Reconstruction(flown / "before" / "files" / "model")
    one, *others = export.registered(model)
    seen = {point.point3D_id for point in one.get_observation_points2D()}
    was = {point_id: point.xyz.copy() for point_id, point in model.points3D.items()}
    poses_were = [image.cam_from_world().matrix().copy() for image in others]
    rng = np.random.default_rng(0)
    for point_id in seen:
        model.point3D(point_id).xyz = was[point_id] + rng.normal(0, 0.05, 3)
    adjust_some(model, {one.image_id})
    moved = {point_id: np.linalg.norm(model.point3D(point_id).xyz - xyz) for point_id, xyz in was.items()}
    assert np.median([moved[point_id] for point_id in seen]) < 0.005
    assert not any(moved[point_id] for point_id in was.keys() - seen)
    assert np.array_equal(poses_were, [image.cam_from_world().matrix() for image in others])


@pytest.mark.parametrize(
    ("photos", "control", "why"),
    [
        (18, False, ""),
        (19, False, "5 of 19 photographs are new since all"),
        (16, True, "control points move all poses"),
    ],
)
def test_earlier_photographs_move_where_much_is_new(flown: Path, photos: int, control: bool, why: str) -> None:
    earlier = Earlier(pycolmap.Reconstruction(), flown / "before" / "files", {}, {}, settled=14)
    found = why_all_move(earlier, photos, control)
    assert found.startswith(why) and bool(found) == bool(why)


@pytest.mark.parametrize("change", [{"metric": False}, {"up_from": "gravity"}, {"lat_deg": 1e-4}])
def test_earlier_photographs_move_where_gps_now_tells_another_world(
    flown: Path, tmp_path: Path, change: dict[str, Any]
) -> None:
    earlier = tmp_path / "earlier" / "00"
    shutil.copytree(flown / "before" / "files", earlier)
    world = json.loads((earlier / "world.json").read_text())
    world["origin"]["lat_deg"] += change.pop("lat_deg", 0.0)  # a ten-thousandth is 11 m
    (earlier / "world.json").write_text(json.dumps(world | change))
    outcome = place(flown, tmp_path / "sfm", tmp_path / "earlier")
    assert (outcome["metrics"]["grown_from"], outcome["metrics"]["poses_kept"]) == (14, 0)
    assert "GPS tells another world" in outcome["metrics"]["poses_reason"]
    assert outcome["metrics"]["gps_residual_m_median"] < 0.3


def test_an_earlier_model_of_other_keypoints_is_not_used(flown: Path, tmp_path: Path) -> None:
    outcome = run_sfm(flown / "photos", tmp_path / "sfm", earlier=flown / "earlier", max_features=300)
    assert outcome["metrics"]["grown_from"] == 0
    assert outcome["metrics"]["registered"] == 16


def test_an_earlier_model_of_other_photographs_is_not_used(flown: Path, tmp_path: Path) -> None:
    shutil.copytree(flown / "before" / "files", tmp_path / "earlier" / "00")
    record = json.loads((tmp_path / "earlier" / "00" / "components.json").read_text())
    record["photo_sha256"][0] = "0" * 64
    (tmp_path / "earlier" / "00" / "components.json").write_text(json.dumps(record))
    outcome = place(flown, tmp_path / "sfm", tmp_path / "earlier")
    assert outcome["metrics"]["grown_from"] == 0


def test_auto_maps_many_photographs_another_way() -> None:
    assert choose_mapper("auto", 250, focal_known=False)[0] == "incremental"
    assert choose_mapper("auto", 251, focal_known=True)[0] == "global"
    assert choose_mapper("auto", 251, focal_known=False)[0] == "hierarchical"
    assert choose_mapper("global", 3, focal_known=False) == ("global", "asked for")


@pytest.mark.parametrize(("left", "sizes"), [(0, [8, 6]), (10, [8, 6]), (60, [14])])
def test_a_model_is_no_more_than_its_points_hold_together(flown: Path, left: int, sizes: list[int]) -> None:
    model = pycolmap.Reconstruction(flown / "before" / "files" / "model")
    half = {image.image_id for image in export.registered(model)[:8]}
    seen_by = {i: {element.image_id for element in point.track.elements} for i, point in model.points3D.items()}
    across = [i for i, images in seen_by.items() if images & half and images - half]
    for point in across[left:]:
        model.delete_point3D(point)
    parts = parts_of(model)
    assert [part.num_reg_images() for part in parts] == sizes
    assert all(part.num_points3D() > 100 for part in parts)


@pytest.mark.parametrize("mapper", ["global", "hierarchical"])
def test_other_mappers_find_the_same_flight_and_repeat_to_the_byte(flown: Path, tmp_path: Path, mapper: str) -> None:
    outcome = place(flown, tmp_path / "first", mapper=mapper)
    assert (outcome["metrics"]["mapper"], outcome["metrics"]["registered"]) == (mapper, 16)
    assert any(f"mapped by the {mapper} mapper: asked for" in note for note in outcome["notes"])
    assert worst_m(tmp_path / "first") < 0.15
    place(flown, tmp_path / "second", mapper=mapper)
    views = [(tmp_path / run / "files" / "views.npz").read_bytes() for run in ("first", "second")]
    assert views[0] == views[1]


@pytest.mark.parametrize("focal_35mm", [15, 60, None])
def test_a_wrong_or_missing_focal_length_is_survived(tmp_path: Path, focal_35mm: int | None) -> None:
    photos = take_photos(write_flight(tmp_path / "in", FLIGHT, focal_35mm=focal_35mm), tmp_path / "photos")
    metrics: dict[str, Any] = run_sfm(photos, tmp_path / "sfm")["metrics"]
    assert metrics["registered"] == 16
    assert metrics["focal_source"] == "refined"
    assert metrics["focal_px"] == pytest.approx(FOCAL_PX, rel=0.02)
    assert worst_m(tmp_path / "sfm") < 0.3
