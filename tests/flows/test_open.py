"""`aug3d open` shows the right report, and says where it is on a machine without a screen."""

from __future__ import annotations

import json
import webbrowser
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aug3d_core.store import layout
from aug3d_core.store.published import publish
from aug3d_core.store.store import Store
from flows.cli import app
from tests.tasks.logged import version


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the addresses that a browser is asked for; there is a screen."""
    asked: list[str] = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(webbrowser, "open", lambda address: bool(asked.append(address)) or True)
    return asked


@pytest.fixture
def versions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Return two versions of a scene with reports; the first is published."""
    home = tmp_path / "my home"
    monkeypatch.setenv("AUG3D_HOME", str(home))
    made = [version(home, scene="hill"), version(home, "b", scene="hill")]
    for folder in made:
        (folder / layout.REPORT).write_text("<!doctype html>")
    publish(Store(home), made[0])
    return made


@pytest.mark.parametrize(("name", "which"), [("hill", 1), ("hill@published", 0)])
def test_the_report_of_the_version_that_is_meant_is_shown(
    name: str, which: int, versions: list[Path], opened: list[str]
) -> None:
    done = CliRunner().invoke(app, ["open", name])
    assert done.exit_code == 0, done.output
    assert opened == [(versions[which] / layout.REPORT).as_uri()] and "my%20home" in opened[0]
    assert str(versions[which] / layout.REPORT) in done.output and "no browser" not in done.output


@pytest.mark.skipif("not __import__('sys').platform.startswith('linux')")
def test_without_a_screen_the_path_is_told(
    versions: list[Path], opened: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    told = json.loads(CliRunner().invoke(app, ["open", "hill", "--json"]).stdout)
    assert told == {"report": str(versions[1] / layout.REPORT), "opened": False} and not opened
    assert "no browser here" in CliRunner().invoke(app, ["open", "hill"]).output


def test_a_browser_that_does_not_start_is_no_error(versions: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(webbrowser, "open", lambda _: False)
    done = CliRunner().invoke(app, ["open", "hill"])
    assert done.exit_code == 0 and "no browser here" in done.output


def test_what_is_not_there_is_named(versions: list[Path], opened: list[str]) -> None:
    unknown = CliRunner().invoke(app, ["open", "dale"])
    assert unknown.exit_code == 2 and "hill" in unknown.output
    (versions[1] / layout.REPORT).unlink()
    lost = CliRunner().invoke(app, ["open", "hill"])
    assert lost.exit_code == 1 and "is missing" in lost.output and not opened
