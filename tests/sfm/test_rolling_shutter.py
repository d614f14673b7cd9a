"""Photographs that were read row by row as the camera flew on tell by how much, though adjustment knew nothing of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pandas as pd
import pycolmap
import pytest

from aug3d_core.geometry.similarity import Similarity, fit_similarity
from aug3d_core.geometry.transforms import centres, project
from aug3d_core.photos.files import image_name
from aug3d_core.sfm import export, rolling_shutter
from aug3d_core.sfm.camera_model import adjust
from aug3d_core.sfm.rolling_shutter import (
    MOST_PX,
    RollingShutter,
    measure_rolling_shutter,
    shutter_metrics,
    shutter_notes,
)

WIDTH, HEIGHT, FOCAL_PX, NOISE_PX, POINTS = 1024, 683, 800.0, 0.5, 500
LENS = [FOCAL_PX, WIDTH / 2, HEIGHT / 2, -0.03]


@dataclass(frozen=True)
class Flight:
    """Lines to and fro over ground with houses, and lines across them.

    moved_px: in a photograph over flat ground straight below, from its first row to its last. forward: else the heading stays.
    shaken_px: how each photograph's own turning shears it. middle_px: how far the lens's middle is off.
    """

    seed: int = 0
    moved_px: float = 4.0
    crossing: bool = True
    forward: bool = True
    height_m: float = 60.0
    tilt_deg: float = 0.0
    overlap: float = 0.7
    lines: int = 3
    shots: int = 6
    relief_m: float = 8.0
    shaken_px: float = 0.0
    middle_px: float = 0.0

    @property
    def step_m(self) -> float:
        return (1 - self.overlap) * HEIGHT / FOCAL_PX * self.height_m

    @property
    def share(self) -> float:
        """Of the time between photographs that reading takes."""
        return self.moved_px * self.height_m / FOCAL_PX / self.step_m

    def stations(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return place and way of each photograph, in the order of capture."""
        gap_m = 0.4 * WIDTH / FOCAL_PX * self.height_m
        x, y = (np.arange(n) - (n - 1) / 2 for n in (self.lines, self.shots))
        one = [
            (np.array([x[i] * gap_m, way * j * self.step_m, self.height_m]), np.array([0.0, way, 0.0]))
            for i, way in zip(range(self.lines), np.resize([1.0, -1.0], self.lines), strict=True)
            for j in y
        ]
        quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
        return one + [(quarter @ place, quarter @ way) for place, way in one] if self.crossing else one


@cache
def adjusted(flight: Flight) -> tuple[export.Arrays, pd.DataFrame, np.ndarray]:
    """Return what adjustment makes of the photographs, from the true poses on; their table, and where they were taken."""
    rng = np.random.default_rng(flight.seed)
    stations = flight.stations()
    reach_m = np.abs([place for place, _ in stations]).max(axis=0)[:2] + 0.4 * flight.height_m
    ground = np.column_stack([rng.uniform(-reach_m, reach_m, (POINTS, 2)), rng.normal(0, 0.3, POINTS)])
    ground[::2, 2] += np.abs(rng.normal(0, flight.relief_m, POINTS // 2)) if flight.relief_m else 0.0
    model = pycolmap.Reconstruction()
    size = {"model": "SIMPLE_RADIAL", "width": WIDTH, "height": HEIGHT}
    model.add_camera_with_trivial_rig(pycolmap.Camera(camera_id=1, params=LENS, **size))
    lens = pycolmap.Camera(params=np.add(LENS, [0, flight.middle_px, -flight.middle_px, 0]), **size)
    seen_by: list[list[pycolmap.TrackElement]] = [[] for _ in ground]
    at = np.array([place for place, _ in stations]) + rng.normal(0, 0.3, (len(stations), 3))
    for i, (place, (_, way)) in enumerate(zip(at, stations, strict=True)):
        pose = camera(place, way if flight.forward else np.array([0, 1.0, 0]), flight, rng)
        velocity = way * flight.step_m * flight.share * rng.normal(1, 0.05)
        xy, points = photograph(pose, velocity, ground, lens)
        xy = xy + rng.normal(0, flight.shaken_px, 2) * (xy[:, 1:] / HEIGHT - 0.5) + rng.normal(0, NOISE_PX, xy.shape)
        wrong = rng.random(len(xy)) < 0.01
        xy[wrong] += rng.normal(0, 3, (wrong.sum(), 2))
        keypoints = {"keypoints": xy, "camera_id": 1, "image_id": i + 1, "name": image_name(i)}
        model.add_image_with_trivial_frame(pycolmap.Image(**keypoints), pycolmap.Rigid3d(pose))
        for number, point in enumerate(points):
            seen_by[point].append(pycolmap.TrackElement(i + 1, number))
    for point, elements in enumerate(seen_by):
        if len(elements) > 1:
            model.add_point3D(ground[point], pycolmap.Track(elements), np.zeros(3, np.uint8))
    adjust(model, refine_focal_length=False)
    pycolmap.ObservationManager(model).filter_all_points3D(4.0, 1.5)
    time = pd.Timestamp("2026-05-01 12:00:00.4") + pd.to_timedelta(2.0 * np.arange(len(stations)), "s")
    return export.to_arrays(model), pd.DataFrame({"height_px": HEIGHT, "time": time.floor("s")}), at


def camera(place: np.ndarray, heading: np.ndarray, flight: Flight, rng: np.random.Generator) -> np.ndarray:
    """Return `cam_from_world` of a camera with the heading at the top of its picture, a little unsteady."""
    tilt = np.radians(flight.tilt_deg + rng.normal(0, 1.2))
    heading = heading + np.cross(heading, [0, 0, 1]) * rng.normal(0, 0.03)
    heading = heading / np.linalg.norm(heading)
    z = np.sin(tilt) * heading - np.cos(tilt) * np.array([0, 0, 1.0])
    x = np.cross(heading, [0, 0, 1.0])
    rotation = np.stack([x, np.cross(z, x), z])
    return np.column_stack([rotation, -rotation @ place])


def photograph(
    pose: np.ndarray, velocity: np.ndarray, ground: np.ndarray, lens: pycolmap.Camera
) -> tuple[np.ndarray, np.ndarray]:
    """Return where which points are seen: each in the row in which the camera, flying on, has it."""
    row = np.zeros(len(ground))
    for _ in range(5):
        in_cam = (ground - velocity * row[:, None]) @ pose[:, :3].T + pose[:, 3]
        ahead = np.linalg.norm(in_cam[:, :2], axis=1) < 1.2 * in_cam[:, 2]  # further out the lens folds over
        xy = np.full((len(ground), 2), np.nan)
        xy[ahead] = lens.img_from_cam(in_cam[ahead])
        row = np.clip(np.nan_to_num(xy[:, 1] / HEIGHT - 0.5), -0.6, 0.6)
    inside = np.flatnonzero(((xy > 0) & (xy < [WIDTH, HEIGHT])).all(axis=1))
    return xy[inside], inside


def measured(flight: Flight) -> RollingShutter | None:
    arrays, photos, _ = adjusted(flight)
    return measure_rolling_shutter(arrays.views, arrays.points, arrays.tracks, photos)


FLIGHTS = {
    "crossing lines": Flight(),
    "rows read from the last": Flight(moved_px=-4.0, seed=1),
    "low": Flight(height_m=30.0, seed=2),
    "high, less overlap": Flight(height_m=110.0, overlap=0.6, seed=3),
    "tilted a little": Flight(tilt_deg=10.0, seed=4),
    "the heading stays": Flight(crossing=False, forward=False, lines=5, seed=5),
    "a turning camera": Flight(shaken_px=1.0, seed=6),
    "a lens off its middle": Flight(middle_px=8.0, seed=7),
    "much": Flight(moved_px=9.0, seed=8),
}


@pytest.mark.parametrize("name", FLIGHTS)
def test_what_the_camera_moved_while_it_read_is_found_after_adjustment(name: str) -> None:
    flight, shutter = FLIGHTS[name], measured(FLIGHTS[name])
    assert shutter is not None
    assert shutter.px == pytest.approx(flight.moved_px, rel=0.2)
    assert shutter.low_px < flight.moved_px < shutter.high_px
    assert shutter.word == "seen"
    assert shutter.readout_s == pytest.approx(2 * abs(flight.share), rel=0.2), "photographs of every two seconds"


@pytest.mark.parametrize("flight", [Flight(), Flight(tilt_deg=45.0), Flight(crossing=False, lines=5)])
def test_it_costs_about_a_pixel_of_the_ground_for_each_of_its_own(flight: Flight) -> None:
    """Why a pixel is the bound: less is lost in what noise does to places."""

    def off_px(moved_px: float) -> float:
        errors = []
        for seed in range(2):
            arrays, _, at = adjusted(replace(flight, seed=seed, moved_px=moved_px))
            found = centres(arrays.views.cam_from_world)
            errors.append(np.linalg.norm(fit_similarity(found, at).apply(found) - at, axis=1))
        return float(np.median(errors)) / flight.height_m * FOCAL_PX

    without, four, eight = off_px(0.0), off_px(4.0), off_px(8.0)
    assert without < 2.5, "what noise does"
    assert max(1.3 * without, 1.5) < four < eight < 12


def test_cameras_that_look_forward_tell_less() -> None:
    """All of them see the movement alike, and over flat ground a lens might do the same."""
    flight = Flight(tilt_deg=45.0, moved_px=16.0, lines=4)
    shutter = measured(flight)
    assert shutter is not None
    assert shutter.low_px < 0.6 * flight.moved_px < shutter.high_px, "the ground is farther away"
    assert shutter.readout_s == pytest.approx(2 * flight.share, rel=0.2)
    assert shutter.high_px - shutter.low_px > 4 * MOST_PX


@pytest.mark.parametrize("seed", range(20))
def test_a_shutter_that_opens_at_once_is_never_told(seed: int) -> None:
    crossing = seed % 4 < 3
    flight = Flight(seed=seed, moved_px=0.0, crossing=crossing, tilt_deg=10.0 * (seed % 3), lines=2 if crossing else 3)
    shutter = measured(replace(flight, shaken_px=0.5 * (seed % 2), middle_px=2.0 * (seed % 5)))
    assert shutter is not None
    assert shutter.low_px < 0 < shutter.high_px
    assert shutter.word != "seen" and shutter.readout_s is None and not shutter_notes(shutter)


@pytest.mark.parametrize("relief_m", [0.0, 8.0])
def test_lines_flown_to_and_fro_stretch_the_world_instead(relief_m: float) -> None:
    """Straight down, with the heading at the top of the picture: that is what a stretched ground looks like."""
    shutter = measured(Flight(crossing=False, lines=5, relief_m=relief_m))
    assert shutter is not None
    assert shutter.word == "cannot be told"
    assert shutter.high_px - shutter.low_px > 4 * MOST_PX


def test_who_does_not_fly_tells_nothing() -> None:
    arrays, photos, _ = adjusted(Flight())
    rng = np.random.default_rng(0)
    still = arrays.views.cam_from_world.copy()
    hovering = np.array([10.0, 20.0, 60.0]) + rng.normal(0, 0.05, (len(still), 3))
    still[:, :, 3] = -np.einsum("nij,nj->ni", still[:, :, :3], hovering)
    views = replace(arrays.views, cam_from_world=still)
    assert measure_rolling_shutter(views, arrays.points, arrays.tracks, photos) is None
    every_other = replace(arrays.views, photo_id=2 * arrays.views.photo_id)
    twice = photos.loc[photos.index.repeat(2)].reset_index(drop=True)
    assert measure_rolling_shutter(every_other, arrays.points, arrays.tracks, twice) is None, "neighbours are missing"
    assert shutter_metrics(None)["rolling_shutter"] == "cannot be told" and not shutter_notes(None)


def test_what_fits_exactly_moved_by_nothing() -> None:
    arrays, photos, _ = adjusted(Flight())
    views, points, tracks = arrays.views, arrays.points, arrays.tracks
    in_cam = np.einsum("tij,tj->ti", views.cam_from_world[tracks.view, :, :3], points.xyz[tracks.point])
    in_cam += views.cam_from_world[tracks.view, :, 3]
    exact = replace(tracks, xy=project(in_cam, views.intrinsics[0]))
    shutter = measure_rolling_shutter(views, points, exact, photos)
    assert shutter is not None
    assert shutter.word == "not seen" and abs(shutter.px) < 1e-6


def test_of_many_photographs_and_points_a_part_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rolling_shutter, "_MOST_VIEWS", 16)
    monkeypatch.setattr(rolling_shutter, "_MOST_OBSERVATIONS", 1000)
    shutter = measured(Flight())
    assert shutter is not None
    assert shutter.word == "seen" and shutter.low_px < 4 < shutter.high_px


@pytest.mark.parametrize("shots", [2, 3, 11])
def test_too_few_photographs_tell_nothing(shots: int) -> None:
    arrays, photos, _ = adjusted(Flight(crossing=False, lines=1, shots=shots, moved_px=0.0))
    assert measure_rolling_shutter(arrays.views, arrays.points, arrays.tracks, photos) is None


def test_the_answer_is_in_pixels_of_any_world() -> None:
    arrays, photos, _ = adjusted(Flight())
    turn = camera(np.zeros(3), np.array([0.6, 0.8, 0]), Flight(), np.random.default_rng(1))[:, :3]
    elsewhere = arrays.moved(Similarity(0.02, turn, np.array([5.0, -3.0, 900.0])))
    assert not np.allclose(centres(elsewhere.views.cam_from_world), centres(arrays.views.cam_from_world))
    one, other = (measure_rolling_shutter(it.views, it.points, it.tracks, photos) for it in (arrays, elsewhere))
    assert one is not None and other is not None
    np.testing.assert_allclose(
        [other.px, other.low_px, other.high_px], [one.px, one.low_px, one.high_px], rtol=1e-3, atol=1e-3
    )


def test_without_times_there_is_no_read_out() -> None:
    arrays, photos, _ = adjusted(Flight())
    untimed = photos.assign(time=photos["time"].where(photos.index != 4))
    shutter = measure_rolling_shutter(arrays.views, arrays.points, arrays.tracks, untimed)
    assert shutter is not None
    assert shutter.word == "seen" and shutter.readout_s is None
    [note] = shutter_notes(shutter)
    assert "rolling shutter" in note and "of the speed" in note and "read in" not in note


def test_the_word_follows_the_interval() -> None:
    def word(px: float, half: float) -> str:
        return RollingShutter(px, px - half, px + half, None).word

    assert word(3, 1.5) == word(-3, 1.5) == "seen"
    assert word(0.2, 0.5) == word(-0.2, 0.5) == "not seen"
    assert word(3, 2.5) == word(0, 2) == word(0.9, 0.2) == "cannot be told"


def test_the_note_says_what_it_costs_and_what_to_do() -> None:
    shutter = RollingShutter(-4.0, -4.5, -3.5, 0.033)
    [note] = shutter_notes(shutter)
    assert (
        "by 4.0 px (3.5 to 4.5)" in note
        and "at 1/4 of the speed" in note
        and "read in 33 ms" in note
        and "mechanical shutter" in note
    )
    assert shutter_metrics(shutter)["readout_ms"] == pytest.approx(33)
    assert not shutter_notes(RollingShutter(4.0, 0.5, 7.5, 0.033)), "it may be less than a pixel"
