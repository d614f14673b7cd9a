"""Ground control points tell the world of a reconstruction, wrong marks and wrong points among them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pycolmap
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.geometry.geodesy import geodetic_from_enu
from aug3d_core.geometry.transforms import apply, centres, look_at
from aug3d_core.photos.files import image_name
from aug3d_core.sfm.align import align_to_control
from aug3d_core.sfm.control import Marked, Survey, marked_points, survey
from tests.sfm.test_align import HEIGHT_M, Flight

ORIGIN = np.array([52.2, 21.0, 110.0])
PLACES = np.array([[-60.0, -40, 0], [60, -40, 2], [60, 40, 0], [-60, 40, 5], [0, 5, 0], [20, -20, 8]])
FOCAL_PX = 900.0


def marked(
    flight: Flight, places: np.ndarray = PLACES, noise_px: float = 0.0, checks: tuple[int, ...] = ()
) -> list[Marked]:
    """Return points as the photographs of a flight show them, each in those that have it within 40 m."""
    cameras = flight.model_from_world.move_cameras(flight.cam_from_world)
    points = []
    for number, place in enumerate(places):
        near = np.flatnonzero(np.linalg.norm((flight.at - place)[:, :2], axis=1) < 40)
        in_cam = apply(flight.cam_from_world[near], np.repeat(place[None, None], len(near), axis=0))[:, 0]
        rays = in_cam[:, :2] / in_cam[:, 2:] + flight.rng.normal(size=(len(near), 2)) * noise_px / FOCAL_PX
        whole = np.full(len(near), FOCAL_PX)
        told = geodetic_from_enu(place, ORIGIN)
        points.append(
            Marked(f"P{number}", number in checks, told, near, cameras[near], rays, whole, whole * 0 + 8, near + 2)
        )
    return points


def errors_m(flight: Flight, told: Survey) -> np.ndarray:
    """Return how far from its place the world has each camera."""
    assert told.world_from_model is not None
    found = told.world_from_model.apply(flight.model_from_world.apply(flight.at))
    origin_m = np.median(PLACES, axis=0)
    return np.linalg.norm(found - (flight.at - origin_m), axis=1)


@given(st.integers(0, 1000))
def test_exact_marks_give_the_exact_world(seed: int) -> None:
    flight = Flight(seed)
    told = survey(marked(flight, checks=(4,)))
    assert told.problem == "" and told.remarks == ()
    assert errors_m(flight, told).max() < 0.01  # of the earth's curve
    assert told.table["role"].tolist() == ["control"] * 4 + ["check", "control"]
    assert max(*told.rms_m("check"), *told.rms_m("control")) < 0.01  # type: ignore[misc]


def test_errors_are_those_of_a_world_without_the_point() -> None:
    """Moving a point where it was surveyed moves its own error by as much, and nobody else's role."""
    flight = Flight(1)
    points = marked(flight)
    off = replace(points[2], geodetic=geodetic_from_enu(PLACES[2] + [0.2, -0.1, 0.1], ORIGIN))
    told = survey([*points[:2], off, *points[3:]])
    moved = told.table.loc[2, ["error_east_m", "error_north_m", "error_up_m"]].to_numpy(float)
    np.testing.assert_allclose(moved, [-0.2, 0.1, -0.1], atol=0.01)
    residual = told.table.loc[2, ["residual_east_m", "residual_north_m", "residual_up_m"]].to_numpy(float)
    assert np.linalg.norm(residual) < 0.7 * np.linalg.norm(moved)


def test_a_check_point_has_no_part_in_the_world() -> None:
    flight = Flight(2)
    points = marked(flight, checks=(4,))
    off = replace(points[4], geodetic=geodetic_from_enu(PLACES[4] + [0, 3.0, 4.0], ORIGIN))
    told = survey([*points[:4], off, points[5]])
    assert told.rms_m("check") == pytest.approx((3, 4), abs=0.01)
    assert told.rms_m("control") == pytest.approx((0, 0), abs=0.01)


def test_a_wrong_mark_is_left_out_and_told() -> None:
    flight = Flight(3)
    points = marked(flight, noise_px=0.5)
    wrong = points[0].rays.copy()
    wrong[1] += 120 / FOCAL_PX
    told = survey([replace(points[0], rays=wrong), *points[1:]])
    assert any(f"line {points[0].line[1]} of the control points marks P0" in note for note in told.remarks)
    assert told.table.loc[0, "marks"] == len(wrong) - 1
    assert errors_m(flight, told).max() < 0.3


def test_a_wrong_point_is_left_out_and_told() -> None:
    flight = Flight(4)
    points = marked(flight, noise_px=0.5)
    off = replace(points[1], geodetic=geodetic_from_enu(PLACES[1] + [6.0, 0, 0], ORIGIN))
    told = survey([points[0], off, *points[2:]])
    assert told.table["role"].tolist() == ["control", "wrong", *["control"] * 4]
    assert any("P1 is " in note and "not used" in note for note in told.remarks)
    assert errors_m(flight, told).max() < 0.4


def test_noise_makes_no_point_wrong() -> None:
    wrong = 0
    for seed in range(50):
        points = marked(Flight(seed), PLACES[:5], noise_px=1.0)
        wrong += int((survey(points).table["role"] == "wrong").sum())
    assert wrong <= 1, "2 % of surveys"


@pytest.mark.parametrize(
    ("points", "told"),
    [
        (lambda flight: marked(flight, PLACES[:2]), "2 of them are marked in two"),
        (lambda flight: marked(flight, checks=(0, 1, 2, 3)), "2 of them are marked in two"),
        (lambda flight: marked(flight, np.array([[-50.0, 0, 0], [0, 0, 0], [50, 0.4, 0]])), "on one line"),
        (lambda flight: [], "0 of them"),
    ],
)
def test_what_tells_no_world_is_told(points, told: str) -> None:
    found = survey(points(Flight(5)))
    assert found.world_from_model is None and told in found.problem


def test_points_that_are_named_like_others_contradict_the_photographs() -> None:
    flight = Flight(6)
    points = marked(flight, PLACES[:4])
    mixed = [replace(one, geodetic=other.geodetic) for one, other in zip(points, points[1:] + points[:1], strict=True)]
    mixed[0], mixed[1] = replace(mixed[0], geodetic=mixed[1].geodetic), replace(mixed[1], geodetic=mixed[0].geodetic)
    assert "contradict the photographs" in survey(mixed).problem


def test_a_point_in_one_photograph_or_from_one_direction_is_not_used() -> None:
    flight = Flight(7)
    points = marked(flight)

    def first(point: Marked, rows: list[int]) -> Marked:
        per_mark = ("photo_id", "cam_from_model", "rays", "focal_px", "wrong_px", "line")
        return replace(point, **{name: getattr(point, name)[rows] for name in per_mark})

    told = survey([first(points[0], [0]), first(points[1], [0, 0]), *points[2:]])
    assert told.table["point"].tolist() == ["P2", "P3", "P4", "P5"]
    assert any("P0 is not used: only one photograph" in note for note in told.remarks)
    assert any("P1 is not used" in note for note in told.remarks)


def test_the_ground_is_put_to_zero_and_its_height_kept() -> None:
    flight = Flight(8)
    told = survey(marked(flight))
    assert told.world_from_model is not None
    world = told.world_from_model.after(flight.model_from_world)
    cameras, points = world.move_cameras(flight.cam_from_world), world.apply(flight.points)
    biased = flight.at - np.median(PLACES, axis=0) + [3.0, 4.0, 0]
    alignment = align_to_control(cameras, points, biased)
    at = centres(alignment.world_from_model.move_cameras(cameras))
    assert np.median(at[:, 2]) == pytest.approx(HEIGHT_M, abs=2)
    assert told.origin[2] + alignment.up_offset_m == pytest.approx(ORIGIN[2], abs=0.3)
    np.testing.assert_allclose(alignment.residual_m, 5, atol=0.02)
    assert alignment.metric and alignment.up_from == "control"


def folding_lens() -> tuple[pycolmap.Reconstruction, pd.DataFrame]:
    """Return six photographs whose lens has no ray in the corners, and marks of four points of these."""
    model, marks = pycolmap.Reconstruction(), []
    camera = pycolmap.Camera(
        camera_id=1, model="SIMPLE_RADIAL", width=1024, height=768, params=[500.0, 512.0, 384.0, -0.12]
    )
    model.add_camera_with_trivial_rig(camera)
    for photo in range(6):
        pose = look_at(np.array([10.0 * photo, photo % 2, 50]), np.array([10.0 * photo, photo % 2 + 0.1, 0]))
        image = pycolmap.Image(image_name(photo), np.zeros((0, 2)), camera_id=1, image_id=photo + 1)
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(pose))
        for number, place in enumerate(np.array([[5.0, 5, 0], [30, -10, 1], [40, 12, 2], [20, 15, 0]])):
            told = geodetic_from_enu(place, ORIGIN)
            pixel = camera.img_from_cam((pose[:, :3] @ place + pose[:, 3])[None])[0]
            marks.append((f"P{number}", False, *told, photo, *pixel, len(marks) + 2))
    columns = ["point", "check", "lat_deg", "lon_deg", "alt_m", "photo_id", "x_px", "y_px", "line"]
    return model, pd.DataFrame(marks, columns=columns)


def test_a_mark_where_the_lens_has_no_ray_is_left_out_and_told() -> None:
    model, marks = folding_lens()
    of_one = marks.index[marks["point"] == "P0"]
    marks.loc[of_one[0], ["x_px", "y_px"]] = 15.0, 12.0
    told = survey(marked_points(model, marks))
    line = int(marks["line"][of_one[0]])
    assert told.remarks == (f"line {line} of the control points marks P0 where the lens has no ray: not used",)
    assert told.wrong_lines == (line,), "an adjustment to control points leaves it out too"
    assert told.table["marks"].tolist() == [5, 6, 6, 6]
    assert max(told.rms_m("control") or (np.inf,)) < 0.01


@pytest.mark.parametrize("left", [0, 1])
def test_a_point_whose_marks_have_no_rays_is_not_used(left: int) -> None:
    model, marks = folding_lens()
    of_one = marks.index[marks["point"] == "P0"]
    marks.loc[of_one[left:], ["x_px", "y_px"]] = 15.0, 12.0
    told = survey(marked_points(model, marks))
    assert told.table["point"].tolist() == ["P1", "P2", "P3"] and told.world_from_model is not None
    assert told.remarks[-1] == "control point P0 is not used: fewer than two of its marks can be"
    assert len(told.wrong_lines) == 6 - left
