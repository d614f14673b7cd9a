import numpy as np
import pytest

from aug3d_core.town.config import TownConfig
from aug3d_core.town.drone.paths import PATHS, footprint_m


def stations(path: str, seed: int = 0, **changes) -> np.ndarray:
    """Rows of x, y, heading_x, heading_y, altitude_m, tilt_deg."""
    return np.array(list(PATHS[path](TownConfig(path=path, **changes), np.random.default_rng(seed))))


@pytest.mark.parametrize("path", PATHS)
def test_every_path_stays_near_the_town_and_above_it(path):
    flown = stations(path)
    config = TownConfig()
    look_m = flown[:, 4] * np.tan(np.radians(flown[:, 5]))
    looked_at = flown[:, :2] + look_m[:, None] * flown[:, 2:4]
    assert (np.abs(looked_at) <= np.array([config.length_m, config.width_m]) / 2 + 15).all()
    np.testing.assert_allclose(np.linalg.norm(flown[:, 2:4], axis=1), 1)
    assert (flown[:, 4] >= 30).all() and (flown[:, 5] <= 45).all()
    np.testing.assert_array_equal(flown, stations(path))


def test_nadir_looks_straight_down_on_the_lawnmowers_grid():
    nadir, mower = stations("nadir"), stations("lawnmower", tilt_deg=0)
    np.testing.assert_array_equal(nadir, mower)
    assert (nadir[:, 5] == 0).all()


@pytest.mark.parametrize(("path", "tilt_deg"), [("crossed", 12), ("oblique", 40)])
def test_crossed_lines_are_flown_both_ways_with_the_same_overlaps(path, tilt_deg):
    flown, config = stations(path), TownConfig()
    east_west = np.abs(flown[:, 2]) == 1
    assert (flown[:, 5] == tilt_deg).all()
    across, along = footprint_m(config)
    for one_way, axis in ((flown[east_west], 0), (flown[~east_west], 1)):
        line = one_way[one_way[:, 1 - axis] == one_way[0, 1 - axis]]
        assert len(line) > 2
        np.testing.assert_allclose(1 - np.abs(np.diff(line[:, axis])) / along, config.forward_overlap)
        lines = np.unique(np.round(one_way[:, 1 - axis], 6))
        np.testing.assert_allclose(1 - np.diff(lines) / across, config.side_overlap, atol=1e-6)
    headings = {tuple(h) for h in np.round(flown[:, 2:4])}
    assert len(headings) == 4, "facades are seen from all four sides"


def test_an_orbit_looks_inwards_and_overlaps_sideways():
    flown, config = stations("orbit"), TownConfig()
    radius = np.linalg.norm(flown[:, :2], axis=1)
    np.testing.assert_allclose(flown[:, 2:4], -flown[:, :2] / radius[:, None], atol=1e-9)
    assert radius.max() == pytest.approx(config.width_m / 2)
    outer = flown[np.isclose(radius, radius.max())]
    step = 2 * np.pi * radius.max() / len(outer)
    assert 1 - step / footprint_m(config)[0] == pytest.approx(config.forward_overlap, abs=0.02)
    assert len(np.unique(np.round(radius, 6))) >= 2
    # No camera looks past the axis: what it sees best is the town.
    assert (flown[:, 4] * np.tan(np.radians(flown[:, 5])) <= radius + 1e-9).all()


def test_a_kite_drifts_turns_about_and_changes_scale():
    kite, mower = stations("free"), stations("nadir")
    assert len(kite) == len(mower)
    drift = np.linalg.norm(kite[:, :2] - mower[:, :2], axis=1)
    assert 2 < np.median(drift) < 25
    assert np.ptp(kite[:, 4]) > 0.4 * TownConfig().altitude_m
    turns = np.degrees(np.arccos(np.clip((kite[1:, 2:4] * kite[:-1, 2:4]).sum(axis=1), -1, 1)))
    assert 8 < np.median(turns) < 40 and np.abs(kite[:, 2:4].mean(axis=0)).max() < 0.95
    assert 0 < kite[:, 5].mean() < 20


@pytest.mark.parametrize("seed", range(5))
def test_abrupt_legs_are_straight_and_turn_sharply(seed):
    flown, config = stations("abrupt", seed), TownConfig()
    assert len(flown) == len(stations("lawnmower"))
    cosine = (flown[1:, 2:4] * flown[:-1, 2:4]).sum(axis=1)
    turned = cosine < 1 - 1e-9
    assert turned.sum() >= 3
    assert (cosine[turned] <= np.cos(np.radians(60)) + 1e-9).all()
    steps = np.linalg.norm(np.diff(flown[:, :2], axis=0), axis=1)[~turned]
    np.testing.assert_allclose(1 - steps / footprint_m(config)[1], config.forward_overlap)
