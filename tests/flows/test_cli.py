"""Wrong use is told at once, with exit code 2 and what to do; nothing heavy is started for it."""

from __future__ import annotations

import json
import socket
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aug3d_core.run.limits import LIMIT_MEMORY
from flows.cli import app


def invoke(*arguments: str | Path):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "a.jpg").write_bytes(b"a photograph")
    return tmp_path / "photos"


@pytest.mark.parametrize("name", ["../escape", "a/b", "two words", "", ".hidden", "x" * 65, "-flag-like/"])
def test_a_scene_name_that_could_leave_its_folder(name: str, folder: Path, tmp_path: Path) -> None:
    result = invoke("run", "--photos", folder, "--home", tmp_path / "home", "--", name)
    assert result.exit_code == 2
    assert "is not a scene name" in result.output and repr(name)[1:-1] in result.output
    assert not (tmp_path / "home").exists()


def test_a_folder_that_does_not_exist(tmp_path: Path) -> None:
    result = invoke("run", "scene", "--photos", tmp_path / "missing", "--home", tmp_path / "home")
    assert result.exit_code == 2
    assert "missing does not exist" in result.output.replace("\n", "")


def test_not_a_folder(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(b"x")
    result = invoke("run", "scene", "--photos", tmp_path / "a.jpg", "--home", tmp_path / "home")
    assert result.exit_code == 2
    assert "is a file, not a folder" in result.output.replace("\n", "")


@pytest.mark.parametrize("more", [(), ("--dry-run",)])
def test_a_folder_without_photographs(more: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    result = invoke("run", "scene", "--photos", tmp_path / "empty", "--home", tmp_path / "home", *more)
    assert result.exit_code == 2
    assert "empty holds no photographs" in result.output.replace("\n", "")


def test_an_unknown_preset(folder: Path, tmp_path: Path) -> None:
    result = invoke("run", "scene", "--photos", folder, "--home", tmp_path / "home", "--preset", "huge")
    assert result.exit_code == 2
    assert "'huge'" in result.output and "tiny, small, paper" in result.output


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("training.steps=-5", ["training.steps", "-5", "greater than"]),
        ("training.steps=many", ["training.steps", "many", "integer"]),
        ("training.step=5", ["no field 'step'", "steps"]),
        ("trainign.steps=5", ["no stage 'trainign'", "training"]),
        ("training.steps", ["not of the form stage.field=value"]),
        ("steps=5", ["not of the form stage.field=value"]),
    ],
)
def test_a_setting_that_is_wrong(setting: str, words: list[str], folder: Path, tmp_path: Path) -> None:
    result = invoke("run", "scene", "--photos", folder, "--home", tmp_path / "home", "--set", setting)
    assert result.exit_code == 2
    assert all(word in result.output for word in words), result.output


def test_a_store_that_cannot_be_opened(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    result = invoke("run", "scene", "--photos", folder, "--home", tmp_path / "file")
    assert result.exit_code == 1
    assert "cannot be opened" in result.output and "--home" in result.output


def test_a_server_that_cannot_be_reached(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket() as taken:  # bound but not listening: nothing answers there
        taken.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{taken.getsockname()[1]}/api"
        monkeypatch.setenv("PREFECT_API_URL", address)
        result = invoke("run", "scene", "--photos", folder, "--home", tmp_path / "home")
    assert result.exit_code == 1
    assert address in result.output and "unset PREFECT_API_URL" in result.output


def test_errors_are_json_where_json_was_asked_for(folder: Path, tmp_path: Path) -> None:
    result = invoke("run", "scene", "--photos", folder, "--home", tmp_path / "home", "--preset", "huge", "--json")
    assert result.exit_code == 2
    told = json.loads(result.stdout)
    assert told["state"] == "refused" and "huge" in told["failure"]["problem"] and told["failure"]["remedy"]


def test_show_of_an_unknown_scene_names_the_known(tmp_path: Path) -> None:
    result = invoke("show", "nowhere", "--home", tmp_path)
    assert result.exit_code == 2
    assert "nowhere" in result.output and "none yet" in result.output


def test_a_dry_run_says_what_would_be_computed(tmp_path: Path) -> None:
    result = invoke("demo", "--home", tmp_path, "--dry-run", "--json")
    assert result.exit_code == 0
    plan = json.loads(result.stdout)
    assert plan[0]["stage"] == "town" and plan[-1]["stage"] == "evaluation" and not any(s["cached"] for s in plan)
    assert all(0 < s["seconds"]["low"] < s["seconds"]["likely"] < s["seconds"]["high"] for s in plan)
    assert all(s["peak_mib"] > 0 and s["disk_mib"] >= 0 for s in plan)


def test_a_dry_run_prints_what_each_stage_takes_and_all_together(tmp_path: Path) -> None:
    told = invoke("demo", "--home", tmp_path, "--dry-run").output
    assert "16 to compute" in told and "MiB" in told and "min" in told and "of calibration" in told
    assert "is made in folds" in told


@pytest.mark.parametrize("more", [(), ("--dry-run",)])
def test_a_run_that_cannot_fit_into_memory_is_refused_before_anything_starts(
    more: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(LIMIT_MEMORY, "0.7")
    refused = invoke("demo", "--home", tmp_path, "--json", *more)
    assert refused.exit_code == 1
    failure = json.loads(refused.stdout)["failure"]
    assert "of memory" in failure["problem"] and "--set" in failure["remedy"] and LIMIT_MEMORY in failure["remedy"]
    assert not (tmp_path / "prefect").exists()
    refused = invoke("demo", "--home", tmp_path, "--dry-run")
    assert refused.exit_code == 1 and "what a run would take" in refused.output


@pytest.mark.parametrize("command", [(), ("demo",), ("run",), ("show",), ("open",), ("doctor",)])
def test_help_teaches(command: tuple[str, ...]) -> None:
    result = invoke(*command, "--help")
    assert result.exit_code == 0
    assert "aug3d" in result.output or "--home" in result.output


@pytest.mark.parametrize("words", [("demo",), ("run", "s", "--photos", "."), ("up",)])
def test_a_wrong_limit_is_refused_before_anything_starts(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AUG3D_LIMIT_MEMORY_GIB", "20G")
    result = invoke(*words, "--home", tmp_path / "home", "--json")
    assert result.exit_code == 2 and "AUG3D_LIMIT_MEMORY_GIB is '20G'" in result.stdout
    assert not (tmp_path / "home" / "prefect").exists()


def test_doctor_shows_the_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AUG3D_LIMIT_HOURS", "48")
    monkeypatch.setattr("aug3d_core.doctor._ENGINES", ())
    result = invoke("doctor", "--home", tmp_path, "--json")
    assert "48 h (AUG3D_LIMIT_HOURS)" in next(c["found"] for c in json.loads(result.stdout) if c["name"] == "limits")
    monkeypatch.setenv("AUG3D_LIMIT_HOURS", "-1")
    result = invoke("doctor", "--home", tmp_path, "--json")
    assert result.exit_code == 1 and '"limits"' in result.stdout


def test_doctor_finds_this_machine_able(tmp_path: Path) -> None:
    result = invoke("doctor", "--home", tmp_path, "--json")
    checks = {check["name"]: check for check in json.loads(result.stdout)}
    assert {"python", "pycolmap", "open3d", "bpy", "torch", "memory", "disk"} <= set(checks)
    assert result.exit_code == 0, checks


def test_a_benchmark_of_a_wrong_setting_is_refused_before_anything_is_measured(tmp_path: Path) -> None:
    done = invoke("bench", "geometry", "--set", "town.colour=red", "--home", str(tmp_path / "home"))
    assert done.exit_code == 2
    assert not (tmp_path / "home").exists()
