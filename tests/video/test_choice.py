"""Frames overlap as asked, however fast the drone flew, and the sharper neighbour is taken."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aug3d_core.run.errors import InputError
from aug3d_core.video.choice import Frame, kept_frames, seconds_of
from tests.video.films import SIZE_PX, flight, picture, write_film


def kept(film: Path, overlap: float = 0.7) -> list[Frame]:
    return [frame for _, frame in kept_frames(film, overlap) if frame is not None]


@pytest.mark.parametrize("px_per_s", [60.0, 200.0])
def test_neighbours_overlap_as_asked_at_any_speed(tmp_path: Path, px_per_s: float) -> None:
    film = write_film(tmp_path / "a.mp4", flight(800 / px_per_s, px_per_s))
    frames = kept(film)
    at = np.array([frame.second * px_per_s for frame in frames])
    overlap = 1 - np.diff(at) / SIZE_PX[0]
    assert (overlap[:-1] >= 0.68).all() and overlap[:-1].mean() < 0.86, overlap
    assert np.allclose([frame.overlap for frame in frames[1:]], overlap, atol=0.05)


def test_a_hovering_drone_gives_one_frame(tmp_path: Path) -> None:
    assert len(kept(write_film(tmp_path / "a.mp4", [picture(50)] * 40))) == 1


def test_of_neighbours_the_sharpest_is_kept(tmp_path: Path) -> None:
    soft = [i for i in range(100) if i % 4]
    frames = kept(write_film(tmp_path / "a.mp4", flight(10, 100.0, blurred=soft)), 0.6)
    sharp = [frame.number not in soft for frame in frames[1:]]
    assert np.mean(sharp) > 0.8, "a quarter of the frames is sharp"


def test_after_a_cut_the_next_frame_is_kept(tmp_path: Path) -> None:
    film = write_film(tmp_path / "a.mp4", [picture(0)] * 20 + [picture(1500)] * 20)
    frames = kept(film)
    assert len(frames) == 2 and 20 <= frames[1].number < 25 and frames[1].overlap == 0


def test_how_long_a_film_is(tmp_path: Path) -> None:
    assert seconds_of(write_film(tmp_path / "a.mp4", flight(4, 50.0))) == pytest.approx(4.0, abs=0.2)


def test_what_is_no_film_or_has_no_key_frame_is_named(tmp_path: Path) -> None:
    (tmp_path / "b.mp4").write_bytes(b"no film" * 100)
    with pytest.raises(InputError, match=r"b\.mp4 is no film"):
        seconds_of(tmp_path / "b.mp4")
    with pytest.raises(InputError, match=r"c\.mp4"):
        kept(tmp_path / "c.mp4")
    film = write_film(tmp_path / "a.mp4", flight(3, 60.0), key_frames=False)
    with pytest.raises(InputError, match=r"a\.mp4 (is damaged|has no picture)"):
        kept(film)


def test_a_film_that_breaks_off_gives_what_comes_before(tmp_path: Path) -> None:
    film = write_film(tmp_path / "a.mkv", flight(16, 100.0))
    film.write_bytes(film.read_bytes()[: film.stat().st_size // 2])
    got = []
    try:
        for _, frame in kept_frames(film, 0.7):
            got += [frame] if frame else []
    except InputError as error:
        assert "a.mkv is damaged" in error.problem
    assert 3 < len(got) < 16
