"""`aug3d look`: what it prints, writes and refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

import aug3d_core.look.survey  # noqa: F401  (the command loads it when it is called, and OpenCV with it)
from flows.cli import app
from tests.look.flown import lines, take


def looked(*words: str):
    return CliRunner().invoke(app, ["look", *words])


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("AUG3D_HOME", str(tmp_path / "home"))
    return tmp_path


def test_a_page_is_written_here_and_nothing_else(here: Path) -> None:
    take(here / "coast [raw]", lines(5))
    done = looked("coast [raw]")
    assert done.exit_code == 0, done.output
    assert "look good" in done.stdout and "preset tiny" in done.stdout and "page: look_coast [raw].html" in done.stdout
    assert {path.name for path in here.iterdir()} == {"coast [raw]", "look_coast [raw].html"}


def test_programs_get_json(here: Path) -> None:
    take(here / "coast", lines(2))
    done = looked("coast", "--json", "--out", "page.html")
    told = json.loads(done.stdout)
    assert done.exit_code == 0 and told["photographs"] == 16 and told["page"] == str(here / "page.html")
    assert [one["weight"] for one in told["findings"]] == ["warn"] and told["cost"]["tiny"]["seconds"] > 0


def test_photographs_that_will_not_do_end_with_three(here: Path) -> None:
    take(here / "coast", lines(3, along=0.3))
    done = looked("coast")
    assert done.exit_code == 3 and "will not do" in done.stdout and "preset" not in done.stdout
    assert (here / "look_coast.html").exists()


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (("nowhere",), 1, "does not exist"),
        (("coast/shot_000.jpg",), 1, "is a file, not a folder"),
        (("empty",), 1, "is empty"),
        (("coast", "--out", "page.txt"), 2, "no HTML file"),
        (("coast", "--out", "nowhere/page.html"), 2, "no HTML file"),
    ],
)
def test_what_cannot_be_looked_at_is_named(here: Path, words: tuple[str, ...], code: int, says: str) -> None:
    take(here / "coast", lines(1, 1))
    (here / "empty").mkdir()
    done = looked(*words)
    assert done.exit_code == code and says in " ".join(done.output.split())
    assert not [*here.glob("*.html")]
