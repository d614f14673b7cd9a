"""The photographs that are asked for fill what is missing, best first, and look where it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from aug3d_core.advice import choice
from aug3d_core.advice.choice import HIGHER, Choice, asked_for, candidates, chosen, pose, usual_look
from aug3d_core.advice.site import Site, site_of
from aug3d_core.geometry.transforms import centres, forward
from aug3d_core.geometry.views import Views
from aug3d_core.run.errors import InputError
from tests.advice.flown_site import HIGH_M, PICTURE_M, ROOF_M, ground_points, mesh, orbit, site, views


def quiet(what: str, done: int, total: int) -> None:
    pass


def advice(of: Site, skipped_m: float, count: int = 6, error: np.ndarray | None = None) -> Choice:
    error = np.ones(len(of.samples.xyz)) if error is None else error
    return chosen(of, views(skipped_m), error, count, quiet)


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


def test_each_photograph_adds_what_is_said() -> None:
    choice = advice(site(50.0), 50.0, count=12)
    left = np.array(choice.missing)
    adds = [one.adds for one in sorted(choice.advised, key=lambda one: one.rank)]
    assert (np.diff(left) < 0).all() and adds[0] == max(adds)
    assert np.allclose(-np.diff(left) / left[0], adds, rtol=1e-3)
    assert np.nanmean(choice.after) < np.nanmean(choice.before)


def test_none_is_asked_for_twice() -> None:
    few = views().take(np.arange(0, 121, 30))  # five photographs: a second one from the same place would count
    choice = chosen(site(), few, np.ones(len(site().samples.xyz)), 400, quiet)
    assert len({(one.xyz, one.yaw_deg) for one in choice.advised}) == len(choice.advised) > 30


def test_a_gap_misses_more_than_none_and_the_first_advice_is_for_it() -> None:
    without, gap = advice(site(), 0.0), advice(site(50.0), 50.0)
    assert gap.missing[0] > 1.2 * without.missing[0]
    assert gap.advised[0].poor > 0.5 and without.advised[0].adds < gap.advised[0].adds


def test_where_the_model_errs_more_is_asked_for() -> None:
    place = site()
    east = place.samples.xyz[:, 0] > 40
    spots = look_spots(advice(place, 0.0, count=4, error=np.where(east, 2.0, 0.5)))
    assert (spots[:, 0] > 20).all(), spots


def test_views_are_asked_for_among_the_photographs_also_in_a_gap_and_not_outside() -> None:
    flown = views(50.0)
    bare = np.ones(len(site(50.0).samples.xyz))
    (stand, _), (asked, turn) = candidates(site(50.0), flown, bare), asked_for(site(50.0), flown, bare)
    assert np.abs(stand[:, :2]).max() > 80 and np.abs(asked[:, :2]).max() <= 75 + 1e-6
    assert (np.abs(asked[:, :2]).max(axis=1) < 25).sum() >= 4
    assert len(turn) == len(asked) and np.allclose(asked[:, 2], HIGH_M, atol=0.5)


def test_of_a_large_site_places_are_where_it_is_barest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choice, "_MOST_PLACES", 12)
    bare = (np.abs(site().samples.xyz[:, :2] - [40, -30]).max(axis=1) < 25).astype(float)
    stand, turn = candidates(site(), views(), bare)
    assert len(stand) == len(turn) == 24
    assert np.abs(stand[:, :2] - [40, -30]).max() < 32
    assert np.abs(candidates(site(), views(), 1 - bare)[0][:, :2] - [40, -30]).max() > 50


def test_where_photographs_lie_in_a_line_all_that_may_be_taken_is_asked_for() -> None:
    row = views()
    row = row.take(np.flatnonzero(np.abs(centres(row.cam_from_world)[:, 1]) < 1))
    bare = np.ones(len(site().samples.xyz))
    assert len(asked_for(site(), row, bare)[0]) == len(candidates(site(), row, bare)[0])


@pytest.mark.parametrize(
    "margin, high_m, told_m", [(15.0, 60, 72), (15.0, 110, 120), (15.0, 130, 130), (None, 130, 156)]
)
def test_photographs_are_taken_from_a_little_higher_as_far_as_is_lawful(
    margin: float | None, high_m: float, told_m: float
) -> None:
    place = site(margin=margin)
    place = replace(place, height=place.height * high_m / HIGH_M)
    assert place.flown(np.zeros((1, 2)), HIGHER)[0, 2] == pytest.approx(told_m, abs=0.5)
    if high_m == HIGH_M:
        assert np.allclose([one.xyz[2] for one in advice(place, 0.0).advised], told_m, atol=0.5)


def test_no_candidate_stands_below_the_margin_or_looks_past_the_site() -> None:
    place = site(roof_m=80.0)
    stand, turn = candidates(place, views(), np.ones(len(place.samples.xyz)))
    near = np.abs(stand[:, :2] - 40).max(axis=1) < 10 + PICTURE_M / 2
    assert (stand[near, 2] >= 95 - 1e-6).all() and near.any() and (turn[:, 1] == -90).all()
    assert site().flown(np.zeros((1, 2)))[0, 2] == pytest.approx(HIGH_M, abs=0.2) and ROOF_M + 15 < HIGH_M


@pytest.mark.parametrize(
    "tilt_deg, focal_px, count", [(45.0, 500.0, 40), (30.0, 500.0, 40), (45.0, 1500.0, 40), (45.0, 1500.0, 6)]
)
def test_a_tilted_camera_stands_as_far_before_its_aim_as_it_must(tilt_deg: float, focal_px: float, count: int) -> None:
    flown = orbit(tilt_deg, focal_px).take(np.arange(count))
    place = site_of(mesh(), flown, ground_points(), 15.0)
    stand, turn = candidates(place, flown, np.ones(len(place.samples.xyz)), HIGHER)
    step, wanted = place.picture / 4, place.area.middle(place.area.wanted)
    for yaw in np.unique(turn[:, 0]):
        here = turn[:, 0] == yaw
        towards = np.array([np.sin(np.radians(yaw)), np.cos(np.radians(yaw))])
        aims = stand[here, :2] + towards * HIGHER * HIGH_M * np.tan(np.radians(tilt_deg))
        assert KDTree(aims).query(wanted)[0].max() < 1.5 * step, "each place is aimed at"
    assert place.area.cell_of(stand[:, :2])[1].all(), "it is known what stands there"
    assert len(chosen(place, flown, np.ones(len(place.samples.xyz)), 3, quiet).advised)


def test_where_no_view_shows_the_site_that_is_said() -> None:
    place = site()
    turned = replace(place, samples=replace(place.samples, normal=-place.samples.normal))
    with pytest.raises(InputError, match="no view like the flight's own shows any of the ground"):
        advice(turned, 0.0)


@pytest.mark.parametrize("yaw, tilt", [(0.0, 0.0), (20.0, 12.0), (179.0, 30.0)])
def test_lines_that_are_flown_both_ways_have_one_axis(yaw: float, tilt: float) -> None:
    rng = np.random.default_rng(0)
    turned = [yaw + 180 * (i % 2) + rng.normal(0, 2) for i in range(40)]
    poses = np.stack([pose(np.zeros(3), one, tilt - 90) for one in turned])
    found, (there, back) = usual_look(Views(np.arange(40), poses, np.ones((40, 4)), np.ones((40, 2), int)))
    assert found == pytest.approx(tilt, abs=0.1) and back == there + 180
    assert (there - yaw + 90) % 180 - 90 == pytest.approx(0.0, abs=1.5)
