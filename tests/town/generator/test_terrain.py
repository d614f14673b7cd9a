import numpy as np
import pytest

from aug3d_core.geometry.transforms import centres
from aug3d_core.town.config import TownConfig
from aug3d_core.town.drone.flight import plan_flight
from aug3d_core.town.generator.terrain import HILLS, Terrain, bend, terrain_of, unbend_xy
from aug3d_core.town.generator.town import build_town

AT = np.random.default_rng(0).uniform(-110, 110, (500, 2))


def test_a_slope_rises_by_its_angle():
    land = Terrain("slope", 15.0)
    x, y = AT.T
    np.testing.assert_allclose(land.height(x, y), np.tan(np.radians(15)) * y)


def test_terraces_are_level_between_steps_and_keep_the_mean_slope():
    land, y = Terrain("terraces", 10.0), np.linspace(-90, 90, 18_001)
    height = land.height(np.zeros_like(y), y)
    level = np.abs(np.diff(height)) < 1e-9
    assert level.mean() == pytest.approx(1 - 4 / 30, abs=0.01)
    np.testing.assert_allclose(np.unique(np.round(np.diff(np.unique(np.round(height[1:][level], 6))), 3)), 5.290)
    np.testing.assert_allclose(np.polyfit(y, height, 1)[0], np.tan(np.radians(10)), rtol=0.02)
    assert (np.diff(height) >= -1e-9).all()


def test_a_lake_is_level_and_the_shore_meets_the_land():
    land = terrain_of(TownConfig(lake=True, terrain="slope"))
    dry = terrain_of(TownConfig(terrain="slope"))
    beyond = land.lake.beyond_m(*AT.T)
    assert (beyond < 0).any() and (beyond > 8).any()
    np.testing.assert_array_equal(land.height(*AT[beyond < 0].T), land.water_level())
    np.testing.assert_allclose(land.height(*AT[beyond > 8].T), dry.height(*AT[beyond > 8].T))


def test_unbending_undoes_bending():
    flat = np.concatenate([AT, np.zeros((len(AT), 1))], axis=1)
    np.testing.assert_allclose(unbend_xy(bend(flat)[:, :2]), AT, atol=1e-6)


def test_bending_lifts_by_the_height_of_the_plan_s_own_place():
    flat = np.concatenate([AT, np.full((len(AT), 1), 2.5)], axis=1)
    land = Terrain("terraces", 12.0)
    np.testing.assert_allclose(bend(flat, land)[:, 2], 2.5 + land.height(*AT.T))
    np.testing.assert_array_equal(bend(flat, land)[:, :2], bend(flat, HILLS)[:, :2])


@pytest.mark.parametrize("kind", ["slope", "terraces"])
def test_houses_stand_level_with_their_feet_in_the_ground(kind):
    """Flat roofs stay horizontal, and no wall ends in the air."""
    config = TownConfig(length_m=60, width_m=60, terrain=kind, slope_deg=20, buildings="high_rise")
    land = terrain_of(config)
    town = build_town(config, land, np.random.default_rng(3))
    ground = town.ground.vertices
    np.testing.assert_allclose(ground[:, 2], land.height(*unbend_xy(ground[:, :2]).T), atol=1e-4)
    xyz = town.things.vertices
    for footprint in town.footprints:
        middle = footprint.outline_m.mean(axis=0)
        level = float(land.height(*unbend_xy(middle[None]).T)[0])
        near = xyz[np.linalg.norm(xyz[:, :2] - middle, axis=1) < 12]
        roof = near[np.abs(near[:, 2] - level - footprint.height_m) < 0.05]
        assert len(roof) >= 4 and np.ptp(roof[:, 2]) < 1e-4
        for corner in footprint.outline_m:
            below = near[np.linalg.norm(near[:, :2] - corner, axis=1) < 0.2]
            assert below[:, 2].min() < float(land.height(*unbend_xy(corner[None]).T)[0]) - 0.3


def test_the_flight_keeps_its_height_over_a_slope():
    config = TownConfig(terrain="slope", slope_deg=20)
    land = terrain_of(config)
    at = centres(plan_flight(config, np.random.default_rng(0), land).cam_from_world)
    over = at[:, 2] - land.height(*unbend_xy(at[:, :2]).T)
    np.testing.assert_allclose(over, config.altitude_m, atol=4)
    assert np.ptp(at[:, 2]) > 20
