"""Places are read from every form of subtitles, and those that cannot be right are refused by line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aug3d_core.run.errors import InputError
from aug3d_core.video.subtitles import NOWHERE, Track, beside, read_track
from tests.video.films import write_srt

FORMS = (
    "[latitude: {lat:.6f}] [longitude: {lon:.6f}] [rel_alt: 51.2 abs_alt: {alt:.1f}]",
    "[latitude : {lat:.6f}] [longtitude : {lon:.6f}] [altitude: {alt:.1f}]",
    "GPS ({lon:.6f}, {lat:.6f}, {alt:.1f}), D 3.2m",
    "GPS({lon:.6f},{lat:.6f},{alt:.1f}) BAROMETER:51.2",
)


@pytest.mark.parametrize("form", FORMS)
def test_each_form_tells_the_same_places(tmp_path: Path, form: str) -> None:
    track = read_track(write_srt(tmp_path / "a.SRT", 10, form), 10.0)
    assert np.allclose(track.at(4.5), [46.9 + 4.5e-5, 7.5, 594.5]), "between two"
    assert np.allclose(track.at(-1), track.at(0)) and np.allclose(track.at(99), [46.9 + 9e-5, 7.5, 599])


@pytest.mark.parametrize(
    ("line", "place"),
    [
        ("GPS(131.1660,-25.2088,14) BAROMETER:8.8", (-25.2088, 131.1660, np.nan)),  # Mavic Pro: 14 satellites
        ("GPS (-58.851745, -34.237922, 15), D 3.2m", (-34.237922, -58.851745, np.nan)),  # Phantom 4
        ("GPS(36.6146,-6.1120,0.0M) BAROMETER:79.8M", (36.6146, -6.1120, np.nan)),  # M300
        ("GPS(116.3913,39.9062,51.5M)", (39.9062, 116.3913, 51.5)),  # no latitude is 116
        ("GPS(39.906217,116.391305,69.800)", (39.906217, 116.391305, 69.8)),  # Avata 2
        ("GPS(7.5,46.9,-3.5)", (46.9, 7.5, -3.5)),  # nothing tells
    ],
)
def test_places_of_drones_that_write_them_in_another_order(
    tmp_path: Path, line: str, place: tuple[float, float, float]
) -> None:
    np.testing.assert_array_equal(read_track(write_srt(tmp_path / "a.SRT", 5, line), 5.0).at(2.0), place)


@pytest.mark.parametrize("towards", [1, -1])
def test_between_two_sides_of_the_180th_meridian_the_way_is_the_short_one(towards: int) -> None:
    lon = towards * np.array([179.9998, 179.9999, -180.0, -179.9999])
    track = Track(np.arange(4.0), np.column_stack([np.full(4, -16.8), lon, np.full(4, 90.0)]))
    for second, beyond in ((0.5, -1.5e-4), (1.5, -0.5e-4), (2.5, 0.5e-4), (3.0, 1e-4)):
        place = track.at(second)
        assert abs(place[1]) <= 180
        assert ((towards * place[1] - 180 - beyond) + 180) % 360 - 180 == pytest.approx(0, abs=1e-9)


def test_zeros_are_no_fix_and_without_places_there_is_none(tmp_path: Path) -> None:
    zero = "[latitude: 0.000000] [longitude: 0.000000]"
    assert not len(read_track(write_srt(tmp_path / "a.srt", 5, zero), 5.0).seconds)
    assert np.isnan(read_track(write_srt(tmp_path / "b.srt", 5, "no place"), 5.0).at(1.0)).all()
    assert np.isnan(NOWHERE.at(0.0)).all()


def test_subtitles_are_found_beside_the_film_whatever_their_case(tmp_path: Path) -> None:
    assert beside(tmp_path / "DJI_0001.MP4") is None
    file = write_srt(tmp_path / "DJI_0001.SRT", 3)
    write_srt(tmp_path / "DJI_0002.SRT", 3)
    assert beside(tmp_path / "DJI_0001.MP4") == file


WRONG = {
    "of another film": ("", 30.0, "line 39: its last time is 10.0 s, and the film has 30.0 s"),
    "no times": ("00:00:xx", 10.0, "line 2: .* are no times"),
    "no place on earth": ("latitude: 546.900000", 10.0, "line 3: latitude 546.9, longitude 7.5 is no place on earth"),
    "backwards": ("00:00:09,900 --> 00:00:10,000", 10.0, "line 6: its time lies before"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_right_is_named_by_file_and_line(tmp_path: Path, case: str) -> None:
    instead, seconds, says = WRONG[case]
    file = write_srt(tmp_path / "a.srt", 10)
    text = file.read_text()
    if case == "no times":
        text = text.replace("00:00:00,000 -->", "00:00:xx -->", 1)
    elif case == "no place on earth":
        text = text.replace("latitude: 46.900000", instead, 1)
    elif case == "backwards":
        text = text.replace("00:00:00,000 --> 00:00:01,000", instead, 1)
    file.write_text(text)
    with pytest.raises(InputError, match=says) as told:
        read_track(file, seconds)
    assert str(file) in told.value.problem


def test_a_file_of_other_bytes_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.srt").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(InputError, match="cannot be read"):
        read_track(tmp_path / "a.srt", 10.0)
    (tmp_path / "b.srt").write_text("hello\n")
    with pytest.raises(InputError, match="line 1: there are no times"):
        read_track(tmp_path / "b.srt", 10.0)
