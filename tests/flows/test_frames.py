"""`aug3d frames`: what it prints, writes and refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aug3d_core.video.choice import seconds_of
from flows.cli import app
from tests.video.films import flight, write_film, write_srt


def run(*words: str):
    return CliRunner().invoke(app, ["frames", *words])


@pytest.fixture
def film(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return write_film(tmp_path / "coast.mp4", flight(4, 100.0))


def test_photographs_are_written_and_what_to_do_next_is_said(film: Path) -> None:
    done = run("coast.mp4", "--out", "my photos")
    assert done.exit_code == 0, done.output
    count = len(list(Path("my photos").iterdir()))
    assert (
        f"coast.mp4: {count} photographs of {seconds_of(film):.0f} s, without places" in done.stdout
        and "aug3d look 'my photos'" in done.stdout
        and "--photos 'my photos'" in done.stdout
    )


def test_programs_get_json(film: Path) -> None:
    write_srt(Path("coast.srt"), 4)
    told = json.loads(run("coast.mp4", "--out", "photos", "--json").stdout)
    (one,) = told["films"]
    assert one["photographs"] == one["with_places"] == len(list(Path("photos").iterdir()))


def test_what_is_wrong_is_named(film: Path) -> None:
    write_srt(Path("coast.srt"), 40)
    done = run("coast.mp4", "--out", "photos")
    assert done.exit_code == 1 and "coast.srt, line" in done.output.replace("\n", " ") and not Path("photos").exists()
    assert run("coast.mp4", "--out", ".").exit_code == 2
