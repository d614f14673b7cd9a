"""`aug3d export` hands on what the store holds: wherever the home is now, and only what is whole."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aug3d_core.export import folder_formats as export
from aug3d_core.export import maps
from aug3d_core.store.scenes import new_version, version_paths, write_metrics
from aug3d_core.store.store import Store
from flows import cli, hand_on
from flows.cli import app
from tests.store.little_store import add_object


@pytest.mark.parametrize("form", ["colmap", "nerfstudio"])
def test_a_home_that_was_moved_is_exported_and_an_altered_object_is_not(
    form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(tmp_path / "then")
    records = {stage: add_object(store, stage, "k") for stage in ("photos", "sfm")}
    version = new_version(store, "toy")
    write_metrics(version, {"scene": "toy", "paths": version_paths(store, version, records)})
    (tmp_path / "then").rename(tmp_path / "now")
    given: list[Path | str] = []
    monkeypatch.setattr(export, "export", lambda *what: given.extend(what) or 3)
    words = ["export", "toy", str(tmp_path / "out"), "--format", form, "--home", str(tmp_path / "now"), "--json"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    objects = tmp_path / "now" / "objects"
    assert given == [objects / "sfm/k/files", objects / "photos/k/files", form, tmp_path / "out"]
    (objects / "sfm/k/files/small").write_text("altered")
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 1 and "the sfm of scene 'toy' is gone" in done.output


@pytest.mark.parametrize(
    ("by_control", "says"), [(True, "As true as the control points\n"), (False, "photographs' GPS")]
)
def test_a_map_is_as_true_as_what_tells_its_world(
    by_control: bool, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    told = maps.MapWritten("EPSG:32632", by_control, "m", 0.1, 10, 10, 1.0, 4)
    monkeypatch.setattr(maps, "export_map", lambda *_: told)
    monkeypatch.setattr(hand_on, "_folders", lambda *_: [tmp_path] * 3)
    hand_on.export_map(Store(tmp_path), {}, tmp_path / "map", False)
    assert says in capsys.readouterr().out


def test_the_next_commands_can_be_copied(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    folder = tmp_path / "my scene"
    for form in ("colmap", "nerfstudio"):
        cli._print_exported(form, folder, folder / "images", 3, tmp_path / "my home")
        for line in capsys.readouterr().out.splitlines()[2:]:
            words = shlex.split(line.partition("   (")[0])
            assert {str(folder), str(folder / "sparse/0")} & {*words}
        assert words[-2:] == ["--home", str(tmp_path / "my home")]
    cli._print_next("toy", tmp_path / "my home")
    assert capsys.readouterr().out.count(f"--home '{tmp_path}/my home'   (") == 5
