"""`aug3d view` refuses what it cannot show in one sentence, before the page is opened."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aug3d_core.store.scenes import new_version, version_paths, write_metrics
from aug3d_core.store.store import Store
from flows.cli import app


def invoke(*arguments: str | Path):
    return CliRunner().invoke(app, ["view", *map(str, arguments)])


def test_an_unknown_scene(tmp_path: Path) -> None:
    done = invoke("nowhere", "--home", tmp_path)
    assert done.exit_code == 2 and "no scene 'nowhere'" in done.output


def test_a_scene_without_poses(tmp_path: Path) -> None:
    store = Store(tmp_path)
    version = new_version(store, "begun")
    write_metrics(version, {"scene": "begun", "paths": version_paths(store, version, {})})
    done = invoke("begun", "--home", tmp_path, "--port", "0")
    assert done.exit_code == 2 and "scene 'begun' has no sfm" in done.output


def test_a_port_that_is_taken(tmp_path: Path) -> None:
    store = Store(tmp_path)
    version = new_version(store, "toy")
    write_metrics(version, {"scene": "toy", "paths": version_paths(store, version, {})})
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        done = invoke("toy", "--home", tmp_path, "--port", port)
    assert done.exit_code == 2 and f"port {port} cannot be used" in done.output


def test_a_poor_password(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(tmp_path)
    version = new_version(store, "toy")
    write_metrics(version, {"scene": "toy", "paths": version_paths(store, version, {})})
    monkeypatch.setenv("AUG3D_PASSWORD", "short")
    done = invoke("toy", "--home", tmp_path)
    assert done.exit_code == 2 and "AUG3D_PASSWORD is too poor" in done.output
