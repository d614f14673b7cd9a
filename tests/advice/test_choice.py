"""The photographs that are asked for fill what is missing, best first, and look where it is."""

from __future__ import annotations

import numpy as np
import pytest

from aug3d_core.advice.choice import Choice, candidates, chosen, pose, usual_look
from aug3d_core.advice.need import POOR, look_of, need_of
from aug3d_core.advice.site import Site
from aug3d_core.geometry.transforms import centres, forward
from aug3d_core.geometry.views import Views
from tests.advice.flown_site import HIGH_M, ROOF_M, site, views


def quiet(done: int, total: int) -> None:
    pass


def advice(of: Site, skipped_m: float, count: int = 6, error: np.ndarray | None = None) -> Choice:
    error = np.ones(len(of.samples.xyz)) if error is None else error
    flown = views(skipped_m)
    return chosen(of, flown, need_of(of, flown, error, quiet), error, count, quiet)


def look_spots(choice: Choice) -> np.ndarray:
    """Return where the cameras look on the ground."""
    found = []
    for one in choice.advised:
        ahead = one.xyz[2] / np.tan(np.radians(-one.pitch_deg)) if one.pitch_deg > -90 else 0.0
        yaw = np.radians(one.yaw_deg)
        found.append((one.xyz[0] + ahead * np.sin(yaw), one.xyz[1] + ahead * np.cos(yaw)))
    return np.array(found)


@pytest.mark.parametrize("yaw, pitch", [(0.0, -90.0), (90.0, -60.0), (225.0, -45.0)])
def test_a_pose_looks_where_yaw_and_pitch_say(yaw: float, pitch: float) -> None:
    made = pose(np.array([3.0, -4.0, 50.0]), yaw, pitch)
    east, north, up = forward(made)
    assert np.allclose(centres(made), [3, -4, 50]) and up == pytest.approx(np.sin(np.radians(pitch)))
    assert np.allclose(
        [east, north], np.cos(np.radians(pitch)) * np.array([np.sin(np.radians(yaw)), np.cos(np.radians(yaw))])
    )
    upper = -made[1, :3]  # the upper edge of the picture
    assert np.allclose(np.cross(made[0, :3], made[1, :3]), made[2, :3]) and upper[2] >= -1e-9
    if pitch == -90:
        assert np.allclose(upper[:2], [np.sin(np.radians(yaw)), np.cos(np.radians(yaw))])


def test_advice_looks_into_the_gap() -> None:
    spots = look_spots(advice(site(50.0, hole=True), 50.0))
    assert (np.abs(spots).max(axis=1) < 50).all(), spots


def test_each_photograph_adds_no_more_than_the_one_before_and_all_that_is_said() -> None:
    choice = advice(site(50.0), 50.0, count=12)
    left = np.array(choice.missing)
    adds = [one.adds for one in sorted(choice.advised, key=lambda one: one.rank)]
    assert (np.diff(left) < 0).all() and np.all(np.diff(adds) <= 1e-9)
    assert np.allclose(-np.diff(left) / left[0], adds, rtol=1e-3)


def test_a_gap_misses_more_than_none_and_the_first_advice_is_for_it() -> None:
    without, gap = advice(site(), 0.0), advice(site(50.0), 50.0)
    assert gap.missing[0] > 1.2 * without.missing[0]
    assert gap.advised[0].poor > 0.5 and without.advised[0].adds < gap.advised[0].adds


def test_where_the_model_errs_more_is_asked_for() -> None:
    place = site()
    east = place.samples.xyz[:, 0] > 40
    spots = look_spots(advice(place, 0.0, count=4, error=np.where(east, 2.0, 0.5)))
    assert (spots[:, 0] > 20).all(), spots


def test_a_photograph_counts_less_and_less_and_most_where_it_looks_from() -> None:
    place, flown = site(), views()
    need = need_of(place, flown, np.ones(len(place.samples.xyz)), quiet)
    need.seen[:] = 0.0
    look = look_of(place, flown.cam_from_world[60], flown.intrinsics[60], flown.size[60])
    left = [need.missing]
    for _ in range(3):
        gain = need.added(look).sum()
        need.take(look)
        left.append(need.missing)
        assert left[-2] - left[-1] == pytest.approx(gain, rel=1e-3)
    assert left[0] == pytest.approx(1.0) and (np.diff(left) < 0).all() and (np.diff(np.diff(left)) > 0).all()
    nearest = (look.towards[:, None] * need.directions).sum(axis=-1).argmax(axis=1)
    assert (need.seen[look.sample].argmax(axis=1) == nearest).all()
    assert (np.delete(need.seen, look.sample, axis=0) == 0).all()


def test_directions_are_those_of_the_flight() -> None:
    need = need_of(site(), views(), np.ones(len(site().samples.xyz)), quiet)
    down_deg = np.degrees(np.arccos(need.directions[:, 2]))
    assert down_deg.max() < 50 and down_deg.min() < 10 and len(need.directions) > 10
    assert 0 < (need.missing_at() > POOR).mean() < 0.6


def test_no_candidate_stands_below_the_margin_or_looks_past_the_site() -> None:
    place = site(roof_m=80.0)
    stand, turn = candidates(place, views())
    assert (stand[:, 2] >= 95 - 1e-6).all() and (turn[:, 1] == -90).all()
    assert site().flown(np.zeros((1, 2)))[0, 2] == pytest.approx(HIGH_M, abs=0.2) and ROOF_M + 15 < HIGH_M


@pytest.mark.parametrize("yaw, tilt", [(0.0, 0.0), (20.0, 12.0), (179.0, 30.0)])
def test_lines_that_are_flown_both_ways_have_one_axis(yaw: float, tilt: float) -> None:
    rng = np.random.default_rng(0)
    turned = [yaw + 180 * (i % 2) + rng.normal(0, 2) for i in range(40)]
    poses = np.stack([pose(np.zeros(3), one, tilt - 90) for one in turned])
    found, (there, back) = usual_look(Views(np.arange(40), poses, np.ones((40, 4)), np.ones((40, 2), int)))
    assert found == pytest.approx(tilt, abs=0.1) and back == there + 180
    assert (there - yaw + 90) % 180 - 90 == pytest.approx(0.0, abs=1.5)
