"""Wrong use of `aug3d predict` is told before any engine is started."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from aug3d_core.store.scenes import new_version, version_paths, write_metrics
from aug3d_core.store.store import Store
from flows.cli import app
from flows.predict import _print, fold_notes


def invoke(*arguments: str | Path):
    return CliRunner().invoke(app, ["predict", *map(str, arguments)])


def test_an_unknown_scene(tmp_path: Path) -> None:
    done = invoke("nowhere", "--home", tmp_path)
    assert done.exit_code == 2
    assert "no scene 'nowhere'" in done.output


def test_a_scene_without_a_model(tmp_path: Path) -> None:
    store = Store(tmp_path)
    version = new_version(store, "begun")
    write_metrics(version, {"scene": "begun", "paths": version_paths(store, version, {})})
    done = invoke("begun", "--home", tmp_path)
    assert done.exit_code == 2
    assert "scene 'begun' has no dataset" in done.output


def test_a_model_whose_files_are_gone(tmp_path: Path) -> None:
    store = Store(tmp_path)
    version = new_version(store, "gone")
    write_metrics(version, {"scene": "gone", "objects": {"dataset": {"stage": "dataset", "key": "k"}}})
    done = invoke("gone", "--home", tmp_path)
    assert done.exit_code == 1
    assert "the dataset of scene 'gone' is gone" in done.output


@pytest.mark.parametrize("name", ["view.jpg", "missing/view.png"])
def test_a_picture_that_cannot_be_written(name: str, tmp_path: Path) -> None:
    done = invoke("any", "--home", tmp_path, "--out", tmp_path / name)
    assert done.exit_code == 2
    assert "is no PNG file in a folder that exists" in done.output


def test_poses_that_are_no_file_of_poses(tmp_path: Path) -> None:
    store = Store(tmp_path)
    fields = {
        "recipe": "r", "config": {}, "inputs": {}, "versions": {}, "metrics": {}, "state": "ok", "notes": (),
        "series": {}, "pictures": {}, "seconds": 1.0, "peak_mib": 1.0,
    }  # fmt: skip
    records = {}
    for name in ("photos", "dataset", "training"):
        (store.work_dir(name, "k") / "files").mkdir(parents=True)
        records[name] = store.commit(store.work_dir(name, "k"), name, "k", fields)
    version = new_version(store, "toy")
    write_metrics(version, {"scene": "toy", "paths": version_paths(store, version, records)})
    done = invoke("toy", "--home", tmp_path, "--poses", tmp_path / "poses.txt")
    assert done.exit_code == 2
    assert "is no file that ends in .json" in done.output.replace("\n", "")


def test_a_scene_in_folds_says_whose_model_it_is() -> None:
    assert fold_notes(["dataset", "training", "evaluation"]) == []
    (note,) = fold_notes(["training", "training_fold1", "evaluation_fold1"])
    assert "2 folds" in note
    assert "first fold's" in note


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        ((), "predict takes a scene, or --photos DIR"),
        (("any", "--photos", "."), "predict takes a scene, or --photos DIR"),
        (("--photos", "nowhere"), "--photos nowhere is no folder"),
        (("--photos", ".", "--like", "3"), "--photos goes with --model and --out alone"),
        (("--photos", ".", "--model", "nobody"), "there is no model 'nobody'"),
        (("--photos", ".", "--out", "."), "--out . is no new or empty folder"),
    ],
)
def test_photographs_of_nowhere(words: tuple[str, ...], problem: str, tmp_path: Path) -> None:
    done = invoke(*words, "--home", tmp_path / "home")
    assert done.exit_code == 2
    assert problem in done.output.replace("\n", " ")


def test_a_note_is_text_and_never_markup(capsys: pytest.CaptureFixture[str]) -> None:
    files = {"picture": "view.png", "panel": "panel.png", "inputs": [1]}
    _print({**files, "metrics": {"ground_seen_share": 1.0}, "notes": ["photo [raw] is odd"]})
    assert "note photo [raw] is odd" in capsys.readouterr().out
