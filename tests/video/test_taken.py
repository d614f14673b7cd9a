"""Frames are photographs as the factory reads them: with time, place and names of their own."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import pytest
from PIL import Image

from aug3d_core.photos.exif import read_exif
from aug3d_core.run.errors import InputError, UsageError
from aug3d_core.video.taken import take_frames
from tests.video.films import SIZE_PX, flight, write_film, write_srt


def quiet(film: Path, second: float, of: float) -> None:
    pass


def test_frames_tell_when_and_where_they_were_taken(tmp_path: Path) -> None:
    film = write_film(tmp_path / "DJI 01.mp4", flight(8, 100.0), created="2026-05-01T12:00:00.000000Z")
    write_srt(tmp_path / "DJI 01.SRT", 8)
    (told,) = take_frames([film], tmp_path / "frames", 0.7, quiet)
    files = sorted((tmp_path / "frames").iterdir())
    assert len(files) == told.kept == told.placed > 4 and all(0.6 < one < 0.95 for one in told.overlaps[:-1])
    seen = []
    for file in files:
        with Image.open(file) as image:
            assert image.size == SIZE_PX and file.name.startswith("DJI_01_0")
            seen.append(read_exif(image, image.size))
    assert seen[0].time == datetime(2026, 5, 1, 12) and seen[-1].time and seen[-1].time > seen[0].time
    second = int(files[3].stem[-6:]) / 10
    assert seen[3].lat_deg == pytest.approx(46.9 + second * 1e-5, abs=1e-7) and seen[3].lon_deg == pytest.approx(7.5)
    assert seen[3].alt_m == pytest.approx(590 + second, abs=0.01)


def test_several_films_and_none_of_them_with_places(tmp_path: Path) -> None:
    films = [write_film(tmp_path / f"{name}.mp4", flight(3, 100.0)) for name in "ab"]
    told = take_frames(films, tmp_path / "frames", 0.7, quiet)
    assert [one.placed for one in told] == [0, 0] and {one.stem[0] for one in (tmp_path / "frames").iterdir()} == {
        "a",
        "b",
    }


def test_wrong_subtitles_of_one_film_stop_all_before_anything_is_written(tmp_path: Path) -> None:
    films = [write_film(tmp_path / f"{name}.mp4", flight(3, 100.0)) for name in "ab"]
    write_srt(tmp_path / "b.srt", 40)
    with pytest.raises(InputError, match="of another film"):
        take_frames(films, tmp_path / "frames", 0.7, quiet)
    assert not (tmp_path / "frames").exists()


def test_names_that_would_meet_and_folders_that_hold_something_are_refused(tmp_path: Path) -> None:
    film = write_film(tmp_path / "a b.mp4", flight(1, 100.0))
    with pytest.raises(UsageError, match="same name"):
        take_frames([film, tmp_path / "x" / "a_b.mp4"], tmp_path / "frames", 0.7, quiet)
    with pytest.raises(UsageError, match="not an empty folder"):
        take_frames([film], tmp_path, 0.7, quiet)
