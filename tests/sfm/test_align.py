"""The world is found from GPS, wrong positions and wrong altitudes among it, or from the ground alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from aug3d_core.geometry.geodesy import enu_from_geodetic, geodetic_from_enu
from aug3d_core.geometry.similarity import Similarity
from aug3d_core.geometry.transforms import centres, look_at
from aug3d_core.sfm.align import NOMINAL_HEIGHT, Alignment, align

HEIGHT_M = 60.0


class Flight:
    """A flight over flat ground with houses, in the world and in the arbitrary frame of a reconstruction."""

    def __init__(self, seed: int = 0, strips: int = 5, slope: float = 0.0, climb: float = 0.0) -> None:
        """A flight that climbs does so northward, and looks straight down to half a degree, its head to the north."""
        self.rng = np.random.default_rng(seed)
        east, north = np.meshgrid(np.arange(8) * 20.0 - 70, np.arange(strips) * 25.0 - 12.5 * (strips - 1))
        at = np.stack([east.ravel(), north.ravel(), np.full(east.size, HEIGHT_M)], axis=1)
        at += self.rng.normal(size=at.shape) * 2
        at[:, 2] += climb * at[:, 1]
        aim = at * [1, 1, 0] + np.append(self.rng.uniform(-15, 15, size=(len(at), 2)), np.zeros((len(at), 1)), axis=1)
        if climb:
            aim = at * [1, 1, 0] + [0, 0.1, 0]
        ground = np.append(self.rng.uniform(-100, 100, (1500, 2)), self.rng.normal(size=(1500, 1)) * 0.1, axis=1)
        roofs = np.append(self.rng.uniform(-100, 100, (500, 2)), self.rng.uniform(4, 12, (500, 1)), axis=1)
        self.points = np.concatenate([ground, roofs])
        self.points[:, 2] += slope * self.points[:, 0]
        self.cam_from_world = np.stack([look_at(a, b) for a, b in zip(at, aim, strict=True)])
        if climb:
            sway = Rotation.from_rotvec(np.radians(0.5) * self.rng.normal(size=at.shape)).as_matrix()
            self.cam_from_world = sway @ self.cam_from_world
        turn = Rotation.random(random_state=seed).as_matrix()
        self.model_from_world = Similarity(0.037, turn, self.rng.normal(size=3))

    @property
    def at(self) -> np.ndarray:
        return centres(self.cam_from_world)

    def align(self, gps_enu_m: np.ndarray, swapped_enu_m: np.ndarray | None = None) -> Alignment:
        cameras = self.model_from_world.move_cameras(self.cam_from_world)
        points = self.model_from_world.apply(self.points)
        return align(cameras, points, 0.037 * HEIGHT_M, gps_enu_m, np.random.default_rng(0), swapped_enu_m)

    def found(self, alignment: Alignment) -> np.ndarray:
        return alignment.world_from_model.apply(self.model_from_world.apply(self.at))


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 1000))
def test_exact_gps_gives_the_exact_world(seed: int) -> None:
    flight = Flight(seed)
    alignment = flight.align(flight.at)
    assert alignment.metric
    assert alignment.up_from == "gps"
    found = flight.found(alignment)
    np.testing.assert_allclose(found[:, :2], flight.at[:, :2], atol=1e-5)
    np.testing.assert_allclose(np.ptp(found[:, 2] - flight.at[:, 2]), 0, atol=1e-5)
    assert alignment.up_offset_m == pytest.approx(flight.at[0, 2] - found[0, 2])
    assert np.median(found[:, 2]) == pytest.approx(HEIGHT_M, abs=2)  # z = 0 is the ground


def test_wild_positions_are_ignored() -> None:
    flight = Flight(1)
    gps = flight.at + flight.rng.normal(size=flight.at.shape) * 0.5
    gps[::4] += [300, -500, 40]
    alignment = flight.align(gps)
    offset = flight.found(alignment)[:, :2] - flight.at[:, :2]
    assert np.linalg.norm(offset, axis=1).max() < 1.5
    assert np.nanmedian(alignment.residual_m) < 1.5


def test_photographs_without_gps_do_not_matter() -> None:
    flight = Flight(2)
    gps = flight.at.copy()
    gps[::3] = np.nan
    alignment = flight.align(gps)
    np.testing.assert_allclose(flight.found(alignment)[:, :2], flight.at[:, :2], atol=1e-5)
    assert np.isnan(alignment.residual_m[::3]).all()


def test_altitudes_of_noise_do_not_tilt_the_world() -> None:
    flight = Flight(3)
    gps = flight.at.copy()
    gps[:, 2] = flight.rng.uniform(0, 80, len(gps))
    alignment = flight.align(gps)
    assert alignment.up_from == "gravity"
    found = flight.found(alignment)
    assert np.linalg.norm((found - flight.at)[:, :2], axis=1).max() < 2
    assert np.std(found[:, 2] - flight.at[:, 2]) < 1


def test_a_single_strip_takes_its_roll_from_the_ground() -> None:
    flight = Flight(4, strips=1)
    gps = flight.at + flight.rng.normal(size=flight.at.shape) * [0.5, 0.5, 1.0]
    alignment = flight.align(gps)
    assert alignment.up_from == "gravity"
    up = alignment.world_from_model.rotation @ flight.model_from_world.rotation[:, 2]
    assert np.degrees(np.arccos(up[2])) < 1


def test_good_altitudes_keep_a_slope_a_slope() -> None:
    flight = Flight(5, slope=0.2)
    alignment = flight.align(flight.at + flight.rng.normal(size=flight.at.shape) * 0.3)
    assert alignment.up_from == "gps"
    up = alignment.world_from_model.rotation @ flight.model_from_world.rotation[:, 2]
    assert np.degrees(np.arccos(up[2])) < 0.5


def test_a_fifth_of_the_positions_may_be_200_m_off() -> None:
    flight = Flight(10)
    gps = flight.at + flight.rng.normal(size=flight.at.shape)
    wrong = flight.rng.permutation(len(gps))[: len(gps) // 5]
    way = flight.rng.normal(size=(len(wrong), 2))
    gps[wrong, :2] += 200 * way / np.linalg.norm(way, axis=1, keepdims=True)
    offset = flight.found(flight.align(gps))[:, :2] - flight.at[:, :2]
    assert np.linalg.norm(offset, axis=1).max() < 1.5


def test_the_same_altitude_for_all_is_harmless() -> None:
    flight = Flight(11)
    alignment = flight.align(np.append(flight.at[:, :2], np.full((len(flight.at), 1), 5.0), axis=1))
    assert np.std(flight.found(alignment)[:, 2] - flight.at[:, 2]) < 1
    assert np.median(flight.found(alignment)[:, 2]) == pytest.approx(HEIGHT_M, abs=2)


def test_altitudes_that_drift_do_not_lean_the_world() -> None:
    flight = Flight(12)
    drift_m = np.column_stack([np.zeros((len(flight.at), 2)), np.linspace(0, 20, len(flight.at))])
    alignment = flight.align(flight.at + drift_m + flight.rng.normal(size=flight.at.shape) * 0.3)
    assert alignment.metric
    up = alignment.world_from_model.rotation @ flight.model_from_world.rotation[:, 2]
    assert np.degrees(np.arccos(up[2])) < 1


@settings(max_examples=3, deadline=None)
@given(st.integers(0, 1000), st.floats(-70, 70), st.floats(-70, 70))
def test_swapped_latitude_and_longitude_are_named_and_not_used(seed: int, lat_deg: float, lon_deg: float) -> None:
    flight = Flight(seed)
    noisy = flight.at + flight.rng.normal(size=flight.at.shape)
    origin = np.array([lat_deg, lon_deg, 0.0])
    geodetic = geodetic_from_enu(noisy, origin)
    exchanged = enu_from_geodetic(geodetic[:, [1, 0, 2]], origin[[1, 0, 2]])
    assert flight.align(noisy, exchanged).metric
    alignment = flight.align(exchanged, noisy)
    assert not alignment.metric
    assert "latitude and longitude look swapped" in alignment.problem


def test_without_gps_z_is_up_and_the_scale_nominal() -> None:
    flight = Flight(6)
    alignment = flight.align(np.full((len(flight.at), 3), np.nan))
    assert not alignment.metric
    assert alignment.problem == ""
    up = alignment.world_from_model.rotation @ flight.model_from_world.rotation[:, 2]
    assert np.degrees(np.arccos(up[2])) < 1
    assert np.median(flight.found(alignment)[:, 2]) == pytest.approx(NOMINAL_HEIGHT, rel=1e-6)
    assert np.isnan(alignment.residual_m).all()


def test_gps_of_another_flight_is_reported_and_not_used() -> None:
    flight = Flight(7)
    alignment = flight.align(flight.rng.permutation(flight.at))
    assert not alignment.metric
    assert "contradict the photographs" in alignment.problem


def test_gps_that_stands_still_is_reported_and_not_used() -> None:
    flight = Flight(8)
    alignment = flight.align(np.tile([5.0, 5.0, 50.0], (len(flight.at), 1)))
    assert not alignment.metric
    assert alignment.problem


@pytest.mark.parametrize(("unknown", "up_from"), [(1.0, "gravity"), (0.6, "gps")])
def test_altitudes_that_are_unknown_are_not_level_flight(unknown: float, up_from: str) -> None:
    """A climb that counts as level flight tilts the world: by 5.5 degrees where a tenth of the way is up."""
    flight = Flight(13, climb=0.1)
    gps = flight.at + flight.rng.normal(size=flight.at.shape) * [0.5, 0.5, 0.3]
    gps[flight.rng.permutation(len(gps))[: round(unknown * len(gps))], 2] = np.nan
    alignment = flight.align(gps)
    assert alignment.metric and alignment.up_from == up_from
    up = alignment.world_from_model.rotation @ flight.model_from_world.rotation[:, 2]
    assert np.degrees(np.arccos(up[2])) < 0.5
    found = flight.found(alignment)
    assert np.linalg.norm((found - flight.at)[:, :2], axis=1).max() < 2
    if unknown < 1:
        assert np.median((found - flight.at)[:, 2]) == pytest.approx(-alignment.up_offset_m, abs=0.3)
    else:
        assert np.isnan(alignment.up_offset_m)


def test_two_positions_are_too_few() -> None:
    flight = Flight(9)
    gps = np.full((len(flight.at), 3), np.nan)
    gps[:2] = flight.at[:2]
    alignment = flight.align(gps)
    assert not alignment.metric
    assert "only 2 of the placed photographs have GPS" in alignment.problem


@pytest.mark.parametrize("pitch_deg", [0.0, 10.0, 25.0])
@pytest.mark.parametrize("on_the_wall", [0.2, 0.7])
@pytest.mark.parametrize("portrait", [False, True])
def test_a_wall_flown_along_at_one_heading_is_not_the_ground(
    portrait: bool, on_the_wall: float, pitch_deg: float
) -> None:
    rng = np.random.default_rng(3)
    along, up = np.meshgrid(np.linspace(-50, 50, 12), [10.0, 15.0, 20.0])
    at = np.stack([along.ravel(), np.full(along.size, -20.0), up.ravel()], axis=1)
    ahead = [0, np.cos(np.radians(pitch_deg)), -np.sin(np.radians(pitch_deg))]
    cameras = np.stack([look_at(one, one + ahead) for one in at])
    if portrait:
        cameras = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]) @ cameras
    wall, ground = rng.uniform(-60, 60, (2000, 2)), rng.uniform(-60, 60, (2000, 2))
    wall = np.stack([wall[:, 0], rng.normal(0, 0.05, 2000), np.abs(wall[:, 1]) / 2], axis=1)
    ground = np.stack([ground[:, 0], -np.abs(ground[:, 1]), rng.normal(0, 0.05, 2000)], axis=1)
    points = np.concatenate([wall[: int(2000 * on_the_wall)], ground[int(2000 * on_the_wall) :]])
    model_from_world = Similarity(0.037, Rotation.random(random_state=5).as_matrix(), rng.normal(size=3))
    alignment = align(
        model_from_world.move_cameras(cameras), model_from_world.apply(points), 0.037 * 25,
        at + rng.normal(size=at.shape), np.random.default_rng(0),
    )  # fmt: skip
    found = alignment.world_from_model.rotation @ model_from_world.rotation
    assert np.degrees(np.arccos(np.clip(found[2, 2], -1, 1))) < 5.0
    assert alignment.metric and np.median(alignment.residual_m) < 2.5
