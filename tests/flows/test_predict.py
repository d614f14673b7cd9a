"""Wrong use of `aug3d predict` is told before any engine is started."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from aug3d_core.novel.config import PredictionConfig
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.run.errors import UsageError
from aug3d_core.run.stage import Stage
from aug3d_core.store import layout
from aug3d_core.store.record import Record
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
        (("--photos", "nowhere"), "--photos nowhere does not exist"),
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


def test_a_view_is_predicted_from_as_many_photographs_as_the_model_that_is_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`bare` is a scene whose training failed, and so did that of the last run of `again`."""
    store = Store(tmp_path)

    def made(stage: str, key: str, **config: int) -> Record:
        fields = {
            "recipe": "r", "config": config, "inputs": {}, "versions": {}, "metrics": {}, "state": "ok", "notes": (),
            "series": {}, "pictures": {}, "seconds": 1.0, "peak_mib": 1.0,
        }  # fmt: skip
        (store.work_dir(stage, key) / "files").mkdir(parents=True)
        (store.work_dir(stage, key) / "files" / PHOTO_TABLE).touch()
        return store.commit(store.work_dir(stage, key), stage, key, fields)

    bare = {name: made(name, "k") for name in ("photos", "dataset")}
    untested = bare | {"training": made("training", "untested", input_views=5)}
    tested = untested | {"evaluation": made("evaluation", "k", input_views=6)}
    scenes = {"bare": bare, "untested": untested, "tested": tested, "again": tested}
    for scene, records in [*scenes.items(), ("again", bare)]:
        version = new_version(store, scene)
        write_metrics(version, {"scene": scene, "paths": version_paths(store, version, records)})
    for collection, judged in (("many", []), ("judged", [["evaluation", "lost"], ["evaluation", "by four"]])):
        made("training", collection, input_views=7)
        told = {"collection": collection, "training": {"key": collection}}
        objects = [["dataset", "k"], *judged, ["training", collection]]
        write_metrics(new_version(store, collection, layout.COLLECTIONS), told | {"objects": objects})
    made("evaluation", "by four", input_views=4)
    asked: list[int] = []

    def planned(stage: Stage, config: PredictionConfig, sources: object) -> None:
        asked.append(config.input_views)
        raise UsageError("nothing is built here", "")

    monkeypatch.setattr("flows.predict.work_of", planned)
    words = [("bare", "--model", model) for model in ("towns", "untested", "tested", "again", "many", "judged")]
    for one in (*words, ("tested",), ("untested",), ("tested", "--model", "towns")):
        assert "nothing is built here" in invoke(*one, "--home", tmp_path).output
    assert asked == [3, 5, 6, 6, 7, 4, 6, 5, 3]
