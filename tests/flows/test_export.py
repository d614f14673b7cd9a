"""`aug3d export` hands on what the store holds: wherever the home is now, and only what is whole."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from aug3d_core.export import folder_formats as export
from aug3d_core.store.scenes import new_version, version_paths, write_metrics
from aug3d_core.store.store import Store
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
