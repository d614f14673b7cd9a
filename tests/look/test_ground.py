"""The map of a flight whose every position is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aug3d_core.look.ground import Ground
from aug3d_core.look.survey import Survey, survey_of
from tests.look.flown import HEIGHT_M, WIDTH_M, Shot, dji, lines, pix4d, take, without


def surveyed(folder: Path, shots: list[Shot], **how: object) -> Survey:
    return survey_of(take(folder, shots, **how), lambda *_: None)  # pyright: ignore[reportArgumentType]


def mapped(folder: Path, shots: list[Shot], **how: object) -> Ground:
    ground = surveyed(folder, shots, **how).ground
    assert ground is not None
    return ground


@pytest.mark.parametrize("turning", [False, True])
def test_pictures_tell_the_height_and_where_north_is(tmp_path: Path, turning: bool) -> None:
    shots = lines(turning=turning)
    ground = mapped(tmp_path, shots)
    assert ground.width_m == pytest.approx(WIDTH_M, rel=0.03)
    assert ground.height_m == pytest.approx(HEIGHT_M, rel=0.03) and "pictures" in ground.height_from
    off = (ground.yaw_deg - [shot.yaw_deg for shot in shots] + 180) % 360 - 180
    assert np.abs(off).max() < 3
    apart = ground.enu_m[:, :2] - [(shot.east_m, shot.north_m) for shot in shots]
    assert np.ptp(apart, axis=0) == pytest.approx(0, abs=0.1)
    assert np.ptp(ground.corners_m, axis=1).max() == pytest.approx(WIDTH_M, rel=0.05)


def test_the_drone_is_believed_where_it_tells_its_height(tmp_path: Path) -> None:
    ground = mapped(tmp_path, lines(), xmp=dji)
    assert (ground.height_m == HEIGHT_M).all() and "start" in ground.height_from


def test_a_camera_that_pix4ds_pitch_says_looks_down_shows_the_ground_below_it(tmp_path: Path) -> None:
    ground = mapped(tmp_path, lines(2, turning=True), xmp=pix4d)
    middle = ground.corners_m.mean(axis=1)
    assert middle == pytest.approx(ground.enu_m[:, :2], abs=0.05 * WIDTH_M)
    assert np.ptp(ground.corners_m, axis=1).max() == pytest.approx(WIDTH_M, rel=0.05)


def test_a_line_that_was_not_flown_is_a_gap_and_nothing_else_is(tmp_path: Path) -> None:
    shots = lines(9, across=0.7)
    whole = mapped(tmp_path / "whole", shots)
    missing = mapped(tmp_path / "missing", [*without(shots, 3, 4, 5)])
    assert whole.gaps.sum() == 0 and whole.inside.any()
    assert 0.05 < missing.gaps.sum() / missing.inside.sum() < 0.6
    north, east = np.nonzero(missing.gaps)
    places = missing.low_m + np.stack([east, north], axis=-1) * missing.cell_m
    middle = missing.enu_m[:, 0].mean()
    assert np.abs(places[:, 0] - middle).max() < WIDTH_M / 2, "in the middle, where the lines are missing"


def test_positions_that_cannot_be_right_are_found(tmp_path: Path) -> None:
    shots = lines()
    far = [5, 17]
    wrong = [replace(shot, told_m=(900.0, -400.0)) if i in far else shot for i, shot in enumerate(shots)]
    ground = mapped(tmp_path, wrong)
    assert np.flatnonzero(ground.wild).tolist() == far
    assert ground.width_m == pytest.approx(WIDTH_M, rel=0.03) and np.isnan(ground.corners_m[far]).all()


def test_without_positions_there_is_no_map_and_pictures_tell_the_overlap(tmp_path: Path) -> None:
    survey = surveyed(tmp_path, lines(2), gps=False)
    assert survey.ground is None
    assert np.median(survey.overlaps) == pytest.approx(0.7, abs=0.03)


def test_overlap_is_that_of_the_ground_where_it_is_known(tmp_path: Path) -> None:
    survey = surveyed(tmp_path, lines(2, along=0.6))
    assert np.median(survey.overlaps) == pytest.approx(0.6, abs=0.03)
