"""Commands that show what is there: they make no home, and find what is finished behind a run that failed."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from aug3d_core.run.errors import UsageError
from aug3d_core.store import layout
from aug3d_core.store.scenes import new_version, version_metrics, write_metrics
from aug3d_core.store.store import Store
from flows import reading
from flows.cli import app
from flows.preview import model_named
from flows.reading import read_store, version_with
from tests.tasks.logged import version

READS = (
    "show hill", "view hill", "export hill out --format glb", "scenes list", "scenes show hill", "scenes remove hill --yes",
    "scenes schedule hill --off", "collections list", "collections show all", "collections remove all --yes",
    "collections train all", "run hill", "run hill --dry-run",
)  # fmt: skip


def invoke(line: str) -> Result:
    return CliRunner().invoke(app, line.split())


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("AUG3D_HOME", str(tmp_path / "home"))
    return tmp_path / "home"


@pytest.fixture
def behind(home: Path) -> tuple[Path, Path]:
    """Return a finished version of a scene, and a later one whose run failed before the data set."""
    finished, failed = version(home, scene="hill"), new_version(Store(home), "hill")
    told = version_metrics(finished)
    failure = {"problem": "training.head.start: there is no file", "remedy": "name one"}
    paths = {**told["paths"], "metrics": str(failed / layout.METRICS), "objects": {}}
    nothing = {"state": "failed", "failure": failure, "paths": paths, "objects": {}, "nvs": None}
    write_metrics(failed, {name: value for name, value in (told | nothing).items() if value is not None})
    return finished, failed


@pytest.mark.parametrize("line", READS)
def test_a_home_that_is_not_there_is_named_and_not_made(line: str, home: Path) -> None:
    done = invoke(line)
    assert done.exit_code == 2 and f"there is no home folder {home}" in done.output.replace("\n", "")
    assert not home.exists()


def test_what_machines_share_is_read_into_a_new_home(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UsageError):
        read_store(home)
    monkeypatch.setenv(layout.SHARED_VARIABLE, "s3://shared")
    monkeypatch.setattr(reading, "Store", lambda root: root)
    assert read_store(home) == home


def test_a_failed_run_does_not_hide_a_finished_version(
    home: Path, behind: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    finished, failed = behind
    store = Store(home)
    assert version_with(store, "hill", "dataset", "training") == version_metrics(finished)
    told = capsys.readouterr()
    assert finished.name in told.err and "ended before dataset" in told.err and not told.out
    assert version_with(store, f"hill@{failed.name}", "training") == version_metrics(failed)
    assert version_with(store, "hill") == version_metrics(failed)
    assert not capsys.readouterr().err
    trained = store.place(store.find("training", "a"))  # type: ignore[arg-type]
    for name in ("hill", f"hill@{finished.name}"):
        assert model_named(store, name).path == trained
    with pytest.raises(UsageError, match="training"):
        model_named(store, f"hill@{failed.name}")


def test_show_tells_of_the_failed_run_and_how_to_see_the_version_before(behind: tuple[Path, Path]) -> None:
    finished, failed = behind
    shown = invoke("show hill").output
    assert "failed training.head.start" in shown and f"show hill@{finished.name}" in shown
    earlier, same = invoke(f"show hill@{finished.name}").output, invoke(f"show hill@{failed.name}").output
    assert str(finished / layout.METRICS) in earlier and "training.head.start" not in earlier
    assert "failed training.head.start" in same and f"show hill@{finished.name}" not in same


@pytest.mark.parametrize("line", ["export {} out --format dtu", "view {} --port 0"])
def test_commands_take_what_the_finished_version_has(
    line: str, behind: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def object_of(_: Store, metrics: dict, step: str):
        asked.append(Path(metrics["paths"]["metrics"]).parent)
        raise UsageError(step, "")

    for module in ("flows.cli", "flows.view"):
        monkeypatch.setattr(f"{module}.object_of", object_of)
    finished, failed = behind
    assert {invoke(line.format("hill")).exit_code, invoke(line.format(f"hill@{failed.name}")).exit_code} == {2}
    assert set(asked[:-1]) <= {finished, failed} and asked[0] == finished and asked[-1] == failed
