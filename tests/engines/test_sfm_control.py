"""A list of ground control points beside photographs tells the world to decimetres, where their GPS is off by metres."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from rasterio.crs import CRS
from rasterio.warp import transform

from aug3d_core.geometry.geodesy import enu_from_geodetic, geodetic_from_enu
from aug3d_core.geometry.transforms import apply, centres
from tests.engines.little_scene import FOCAL_PX, ORIGIN, SIZE, poses, write_flight
from tests.engines.sfm_runs import loaded, run_sfm, run_stage, take_photos

pytestmark = pytest.mark.slow
PLACES = np.array([[-20.0, -12, 0], [22, -14, 0], [18, 15, 0], [-19, 13, 0], [1, 0, 0], [10, 3, 0]])
NAMES = ("A", "B", "C", "D", "chk-1", "CHK 2")


def list_marks(folder: Path, names: Sequence[str] = NAMES, shift_m: float = 0.0) -> None:
    """Write where the photographs of `poses` show places of the ground, in UTM; A may be surveyed in a wrong place."""
    cameras = poses()
    lines = ["EPSG:32634"]
    for name, place in zip(names, PLACES, strict=False):
        lat_deg, lon_deg, height = geodetic_from_enu(place + (shift_m if name == "A" else 0), ORIGIN)
        (east,), (north,) = transform(CRS.from_epsg(4326), CRS.from_epsg(32634), [lon_deg], [lat_deg])[:2]
        for number, camera in enumerate(cameras):
            x, y, z = apply(camera[None], place[None, None])[0, 0]
            pixel = FOCAL_PX * np.array([x, y]) / z + np.array(SIZE) / 2
            if (pixel > 10).all() and (pixel < np.array(SIZE) - 10).all():
                mark = (f"{east:.4f}", f"{north:.4f}", f"{height:.4f}", f"{pixel[0]:.2f}", f"{pixel[1]:.2f}")
                lines.append("\t".join((*mark, f"photo_{number}.jpg", name)))
    (folder / "gcp_list.txt").write_text("\n".join(lines))


def off_m(sfm: Path) -> np.ndarray:
    """Return how far each camera is from its true place on earth."""
    world = json.loads((sfm / "files" / "world.json").read_text())
    origin = np.array([world["origin"][key] for key in ("lat_deg", "lon_deg", "alt_m")])
    true = enu_from_geodetic(geodetic_from_enu(centres(poses()), ORIGIN), origin)
    return np.linalg.norm(centres(loaded(sfm)[0].cam_from_world) - true, axis=1)


def with_list(flight: Path, folder: Path) -> Path:
    """Return the photos stage's output of a flight that has a list beside it, its working copies taken over."""
    made = run_stage("photos", folder / "photos", {"folder": flight})
    assert "problem" not in made, made
    return folder / "photos" / "files"


def test_control_points_tell_where_the_world_is_and_check_points_how_well(tmp_path: Path) -> None:
    flight = write_flight(tmp_path / "in", poses(), noise_m=3.0)  # GPS of a plain drone
    alone = run_sfm(take_photos(flight, tmp_path / "gps"), tmp_path / "gps_sfm")
    list_marks(flight)
    photos = with_list(flight, tmp_path)
    inputs = {"photos": photos, "matching": tmp_path / "gps_sfm_matching" / "files"}
    outcome = run_stage("sfm", tmp_path / "sfm", inputs)
    metrics = outcome["metrics"]
    assert (metrics["control_points"], metrics["check_points"], metrics["up_from"]) == (4, 2, "control")
    assert metrics["check_error_horizontal_m"] < 0.1 and metrics["check_error_up_m"] < 0.3
    assert off_m(tmp_path / "sfm").max() < 0.4 < 1 < off_m(tmp_path / "gps_sfm").max()
    assert outcome["state"] == alone["state"] == "ok" and not any("control" in note for note in outcome["notes"])
    table = pd.read_parquet(tmp_path / "sfm" / "files" / "control_points.parquet").set_index("point")
    assert table.loc["chk-1", "role"] == "check" and table["marks"].min() >= 2
    assert metrics["check_error_up_m"] == pytest.approx(
        np.sqrt(np.square(table.loc[["chk-1", "CHK 2"], "error_up_m"]).mean())
    )


def test_without_gps_control_points_give_metres(tmp_path: Path) -> None:
    flight = write_flight(tmp_path / "in", poses(), gps=False)
    list_marks(flight, NAMES[:4])
    outcome = run_sfm(with_list(flight, tmp_path), tmp_path / "sfm")
    assert off_m(tmp_path / "sfm").max() < 0.4
    assert outcome["metrics"]["gps_residual_m_median"] is None
    assert outcome["metrics"]["check_points"] == 0 and outcome["metrics"]["check_error_up_m"] is None
    assert outcome["metrics"]["control_error_up_m"] < 1


def test_too_few_are_told_and_gps_is_used(little_flight: Path, tmp_path: Path) -> None:
    flight = Path(shutil.copytree(little_flight / "in", tmp_path / "in"))
    list_marks(flight, NAMES[:2])
    inputs = {"photos": with_list(flight, tmp_path), "matching": little_flight / "sfm_matching" / "files"}
    outcome = run_stage("sfm", tmp_path / "sfm", inputs)
    assert outcome["state"] == "degraded" and outcome["metrics"]["up_from"] == "gps"
    assert any("the control points are not used: 2 of them" in note for note in outcome["notes"])
    assert off_m(tmp_path / "sfm").max() < 0.8
