"""The matching and sfm stages on photographs whose truth is known, each in a process of its own as the factory runs it."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from aug3d_core.geometry.geodesy import enu_from_geodetic
from aug3d_core.geometry.similarity import fit_similarity
from aug3d_core.geometry.transforms import apply, centres, look_at, project
from tests.engines.little_scene import FOCAL_PX, ORIGIN, poses, write_flight
from tests.engines.sfm_runs import loaded, outcome_of, run_sfm, run_stage, run_stage_killed, take_photos
from tests.same_files import assert_same_files

pytestmark = pytest.mark.slow


@pytest.fixture
def flown(little_flight: Path) -> tuple[Path, dict[str, Any]]:
    """Return a finished stage's folder over 12 photographs with good GPS, and its outcome."""
    return little_flight, outcome_of(little_flight / "sfm")


def true_poses(world: dict[str, Any]) -> np.ndarray:
    """Return the true cameras about the origin that the stage chose."""
    origin = np.array([world["origin"][key] for key in ("lat_deg", "lon_deg", "alt_m")])
    moved = enu_from_geodetic(ORIGIN[None], origin)[0]
    cameras = poses()
    cameras[:, :, 3] -= cameras[:, :, :3] @ moved
    return cameras


def aside(cam_from_world: np.ndarray, east_m: float) -> np.ndarray:
    """Return cameras moved to the east."""
    moved = cam_from_world.copy()
    moved[:, :, 3] -= moved[:, :, 0] * east_m
    return moved


def test_every_camera_is_where_and_how_it_was(flown: tuple[Path, dict[str, Any]]) -> None:
    folder, outcome = flown
    views, _, _ = loaded(folder / "sfm")
    world = json.loads((folder / "sfm" / "files" / "world.json").read_text())
    truth = true_poses(world)
    assert world["metric"] is True
    assert outcome["state"] == "ok"
    np.testing.assert_array_equal(views.photo_id, np.arange(12))
    off_m = np.linalg.norm(centres(views.cam_from_world) - centres(truth), axis=1)
    assert off_m.max() < 0.6  # GPS noise is 0.2 m
    turned = views.cam_from_world[:, :, :3] @ truth[:, :, :3].transpose(0, 2, 1)
    angle_deg = np.degrees(np.arccos(np.clip((np.trace(turned, axis1=1, axis2=2) - 1) / 2, -1, 1)))
    assert angle_deg.max() < 1.0


def test_the_shape_is_right_to_a_tenth_of_a_percent_of_the_height(flown: tuple[Path, dict[str, Any]]) -> None:
    views, _, _ = loaded(flown[0] / "sfm")
    fit = fit_similarity(centres(views.cam_from_world), centres(poses()))
    off_m = np.linalg.norm(fit.apply(centres(views.cam_from_world)) - centres(poses()), axis=1)
    assert np.median(off_m) < 0.05
    assert fit.scale == pytest.approx(1, abs=0.02)


def test_the_ground_is_zero(flown: tuple[Path, dict[str, Any]]) -> None:
    _, points, _ = loaded(flown[0] / "sfm")
    ground = points.xyz[np.abs(points.xyz[:, 2]) < 1]
    assert len(ground) > 0.4 * len(points.xyz)
    assert abs(np.median(ground[:, 2])) < 0.3


def test_observations_are_projections_in_our_conventions(flown: tuple[Path, dict[str, Any]]) -> None:
    views, points, tracks = loaded(flown[0] / "sfm")
    error_px = []
    for i in range(len(views)):
        seen = tracks.view == i
        in_cam = apply(views.cam_from_world[i], points.xyz[tracks.point[seen]])
        assert (in_cam[:, 2] > 0).all()
        error_px.append(np.linalg.norm(project(in_cam, views.intrinsics[i]) - tracks.xy[seen], axis=1))
    assert np.concatenate(error_px).mean() < 0.6
    assert np.abs(np.concatenate(error_px).mean() - points.error_px.mean()) < 0.3
    assert np.bincount(tracks.point).min() >= 2


def test_undistorted_images_have_the_size_of_their_views(flown: tuple[Path, dict[str, Any]]) -> None:
    views, _, _ = loaded(flown[0] / "sfm")
    for photo_id, size in zip(views.photo_id, views.size, strict=True):
        with Image.open(flown[0] / "sfm" / "files" / "images" / f"{photo_id:06d}.png") as image:
            assert image.size == tuple(size)
    np.testing.assert_allclose(views.intrinsics[:, :2], FOCAL_PX, rtol=0.02)


def test_metrics_and_files_are_complete(flown: tuple[Path, dict[str, Any]]) -> None:
    folder, outcome = flown
    metrics = outcome["metrics"]
    assert (metrics["photos"], metrics["registered"], metrics["registered_share"]) == (12, 12, 1.0)
    assert metrics["reprojection_px"] < 0.6
    assert metrics["gps_residual_m_median"] < 0.5
    assert metrics["components"] == 1
    assert metrics["rolling_shutter"] == "cannot be told" and metrics["readout_ms"] is None, "too few"
    assert {path.name for path in (folder / "sfm" / "files" / "model").iterdir()} >= {"cameras.bin", "images.bin"}
    assert not list((folder / "sfm" / "files").glob("tmp*"))
    for picture in outcome["pictures"].values():
        assert (folder / "sfm" / "files" / picture).exists()


def test_any_number_of_threads_gives_the_same_bytes(flown: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    run_sfm(flown[0] / "photos", tmp_path / "one", cpus={min(os.sched_getaffinity(0))})
    first, second = flown[0] / "sfm" / "files", tmp_path / "one" / "files"
    assert_same_files(first, second)


def test_killed_while_it_maps_it_leaves_nothing_of_that_try(flown: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    inputs = {"photos": flown[0] / "photos", "matching": flown[0] / "sfm_matching" / "files"}
    run_stage_killed("sfm", tmp_path / "sfm", inputs, [lambda files: any(files.rglob("features.db"))] * 2)
    whole, again = (
        {file.relative_to(top).as_posix(): file.read_bytes() for file in top.rglob("*") if file.is_file()}
        for top in (flown[0] / "sfm" / "files", tmp_path / "sfm" / "files")
    )
    assert again == whole


def test_photographs_held_together_by_few_points_are_doubted(
    flown: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    run_stage("photos", tmp_path / "photos", {"folder": flown[0] / "in"}, max_px=100)
    outcome = run_sfm(tmp_path / "photos" / "files", tmp_path / "sfm", max_features=256)
    assert outcome["state"] == "degraded"
    assert any("12 photographs that see" in note and "loosely (wanted: 8 and 100)" in note for note in outcome["notes"])


def test_parts_that_few_points_join_are_told(tmp_path: Path) -> None:
    cameras = np.concatenate([aside(poses(3, 2, seed=1), -39), aside(poses(3, 2, seed=2), 39)])
    photos = take_photos(write_flight(tmp_path / "in", cameras, noise_m=0.2), tmp_path / "photos")
    outcome = run_sfm(photos, tmp_path / "sfm")
    assert (outcome["metrics"]["registered"], outcome["state"]) == (12, "degraded")
    assert outcome["metrics"]["weakest_joint_share"] < 0.3
    assert any("6 photographs and the other 6 are joined by" in note for note in outcome["notes"])


def test_a_rolling_shutter_is_told_with_what_to_do(tmp_path: Path) -> None:
    """Three lines to and fro, with one heading; every two seconds, 9 m on, of which reading takes an eighth."""
    rng = np.random.default_rng(0)
    places, read_m = [], []
    for line, way in enumerate([1, -1, 1]):
        places += [np.array([20 * line - 20, 9 * way * shot, 50.0]) + rng.normal(0, 0.3, 3) for shot in range(-3, 4)]
        read_m += [np.array([0, 9 / 8 * way, 0])] * 7
    cameras = np.stack([look_at(at, at * [1, 1, 0] + np.append(rng.uniform(-1, 1, 2), 0)) for at in places])
    photos = take_photos(write_flight(tmp_path / "in", cameras, read_m=np.stack(read_m)), tmp_path / "photos")
    outcome = run_sfm(photos, tmp_path / "sfm")
    metrics, moved_px = outcome["metrics"], 9 / 8 / 50 * FOCAL_PX
    assert metrics["rolling_shutter"] == "seen" and outcome["state"] == "degraded"
    assert metrics["rolling_shutter_low_px"] < moved_px < metrics["rolling_shutter_high_px"]
    assert metrics["readout_ms"] == pytest.approx(250, rel=0.2)
    assert any("fly at 1/" in note for note in outcome["notes"])


def test_without_gps_the_world_is_level_scene_units(tmp_path: Path) -> None:
    photos = take_photos(write_flight(tmp_path / "in", poses(), gps=False), tmp_path / "photos")
    outcome = run_sfm(photos, tmp_path / "sfm")
    world = json.loads((tmp_path / "sfm" / "files" / "world.json").read_text())
    assert world == {
        "metric": False,
        "unit": "scene unit",
        "up_from": "gravity",
        "origin": None,
        "gps_residual_m_median": None,
    }
    assert "no GPS" in outcome["notes"][0]
    views, _, _ = loaded(tmp_path / "sfm")
    fit = fit_similarity(centres(views.cam_from_world), centres(poses()))
    assert np.degrees(np.arccos(fit.rotation[2, 2])) < 2.0
    assert np.median(centres(views.cam_from_world)[:, 2]) == pytest.approx(50, abs=0.5)


def test_the_larger_of_two_scenes_is_taken_and_the_other_kept(tmp_path: Path) -> None:
    write_flight(tmp_path / "in", poses(3, 2), gps=False, seed=1)
    write_flight(tmp_path / "in", poses(4, 2), gps=False, seed=2, start=6)
    outcome = run_sfm(take_photos(tmp_path / "in", tmp_path / "photos"), tmp_path / "sfm")
    views, _, _ = loaded(tmp_path / "sfm")
    np.testing.assert_array_equal(views.photo_id, np.arange(6, 14))
    components = json.loads((tmp_path / "sfm" / "files" / "components.json").read_text())["components"]
    assert [part["photo_ids"] for part in components] == [list(range(6, 14)), list(range(6))]
    assert (tmp_path / "sfm" / "files" / components[1]["folder"] / "images.bin").exists()
    assert outcome["state"] == "degraded"
    assert any("fall into 2 parts" in note and "part 2 holds 6 of 14: photo_0.jpg" in note for note in outcome["notes"])
    unplaced = pd.read_parquet(tmp_path / "sfm" / "files" / "unplaced.parquet")
    assert unplaced["photo_id"].tolist() == list(range(6))
    assert set(unplaced["reason"]) == {"separate island"}


def test_real_photographs_over_a_lake_shore(real_photos: Path, tmp_path: Path) -> None:
    """All of brighton_beach is placed, the flight is as high as the drone's own log says (39.8 m), and not bent."""
    photos = take_photos(real_photos / "brighton_beach" / "images", tmp_path / "photos")
    metrics = run_sfm(photos, tmp_path / "sfm")["metrics"]
    assert metrics["registered"] == 18
    assert metrics["reprojection_px"] < 0.5
    assert metrics["gps_residual_m_median"] < 1.0
    assert metrics["camera_height_m_median"] == pytest.approx(39.8, abs=1.0)
    assert (metrics["camera_model"], metrics["focal_source"]) == ("SIMPLE_RADIAL", "exif")
    assert abs(metrics["doming_pct"]) < 0.5
