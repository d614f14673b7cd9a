"""What a version tells of places is safe to keep and to show."""

from __future__ import annotations

from pathlib import Path

import pytest

from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.run.files import FILES
from aug3d_core.store import layout
from aug3d_core.store.published import publish
from aug3d_core.store.scenes import (
    damaged_versions,
    last_version,
    masked,
    new_version,
    newest_whole,
    newest_with,
    records_before,
    scenes,
    step_objects,
    version_metrics,
    versions,
    write_metrics,
)
from aug3d_core.store.store import Store
from tests.stand_in_stages import EMPTY

MADE = EMPTY | {"metrics": {}, "config": {}, "state": "ok", "seconds": 1.0, "cpu_seconds": 1.0}


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("postgresql+psycopg2://me:a@b:c@db:5432/mlflow", "postgresql+psycopg2://***@db:5432/mlflow"),
        (
            "no route to https://token@there/x, nor to http://other/y",
            "no route to https://***@there/x, nor to http://other/y",
        ),
        ("sqlite:////home/me@work/mlflow.db", "sqlite:////home/me@work/mlflow.db"),
        ("mail me@there", "mail me@there"),
    ],
)
def test_users_and_passwords_of_addresses_are_masked(text: str, shown: str) -> None:
    assert masked(text) == shown


_OBJECTS = {"sfm": ("sfm", "c612"), "grouping_fold1": ("grouping", "1696")}


def test_a_version_names_the_objects_of_its_steps() -> None:
    named = {step: {"stage": stage, "key": key} for step, (stage, key) in _OBJECTS.items()}
    elsewhere = {step: f"/old/objects/{stage}/other/files" for step, (stage, _) in _OBJECTS.items()}
    assert step_objects({"objects": named, "paths": {"objects": elsewhere}}) == _OBJECTS


def test_a_version_of_before_0_7_names_its_objects_by_paths() -> None:
    paths = {step: f"/moved/since/objects/{stage}/{key}/files" for step, (stage, key) in _OBJECTS.items()}
    assert step_objects({"paths": {"metrics": "/moved/since/metrics.json", "objects": paths}}) == _OBJECTS


@pytest.mark.parametrize("content", ["", "{", "[]", '{"scene": "town"'])
def test_a_damaged_version_counts_as_absent_with_a_note(tmp_path: Path, content: str) -> None:
    store = Store(tmp_path)
    whole, damaged = new_version(store, "town"), new_version(store, "town")
    write_metrics(whole, {"scene": "town", "state": "ok"})
    with pytest.raises(UsageError):
        last_version(store, "other")
    (damaged / layout.METRICS).write_text(content)
    assert versions(store, "town") == [whole] and last_version(store, "town")["state"] == "ok"
    (note,) = damaged_versions(store, "town")
    assert str(damaged / layout.METRICS) in note and ("is empty" if not content else "is damaged") in note
    (whole / layout.METRICS).unlink()
    with pytest.raises(StoreError, match=r"no whole version.*metrics\.json is.*\n.*verify --repair"):
        last_version(store, "town")
    assert scenes(store) == []


def test_a_changed_figure_is_seen(tmp_path: Path) -> None:
    version = new_version(Store(tmp_path), "town")
    write_metrics(version, {"scene": "town", "psnr": 21.5})
    assert version_metrics(version) == {"scene": "town", "psnr": 21.5}
    file = version / layout.METRICS
    file.write_text(file.read_text().replace("21.5", "31.5"))
    with pytest.raises(StoreError, match=r"metrics\.json is damaged.*seal"):
        version_metrics(version)


def made(store: Store, *steps: str, key: str = "", **more: Any) -> Path:
    version = new_version(store, "town")
    objects = {step: {"stage": step, "key": key or version.name} for step in steps}
    write_metrics(version, {"scene": "town", "version": version.name, "objects": objects} | more)
    return version


def files_of(store: Store, stage: str, key: str) -> Path:
    work = store.work_dir(stage, key)
    (work / FILES).mkdir(parents=True)
    (work / FILES / "one").write_text(key)
    return work


def test_a_finished_version_is_found_behind_runs_that_ended_before(tmp_path: Path) -> None:
    store = Store(tmp_path)
    made(store, "sfm", "training")
    finished, _ = made(store, "sfm", "training"), made(store, "sfm")
    newest = made(store)
    metrics, note = newest_with(store, "town", "sfm", "training")
    assert metrics["version"] == finished.name
    assert finished.name in note and "town ended before sfm" in note
    assert newest_with(store, "town")[0]["version"] == newest.name


def test_the_last_version_is_taken_without_a_word_where_it_has_all_or_none_has_more(tmp_path: Path) -> None:
    store = Store(tmp_path)
    made(store, "sfm")
    newest = made(store, "sfm")
    for steps in (("sfm",), ("training",), ("sfm", "training")):
        metrics, note = newest_with(store, "town", *steps)
        assert metrics["version"] == newest.name and not note


def test_where_no_version_has_all_the_newest_that_made_most_is_taken(tmp_path: Path) -> None:
    store = Store(tmp_path)
    made(store, "sfm")
    most = made(store, "sfm", "surface")
    made(store, "sfm")
    metrics, note = newest_with(store, "town", "sfm", "surface", "training")
    assert metrics["version"] == most.name and "before surface" in note


def test_a_version_is_whole_once_it_is_tested_in_all_folds(tmp_path: Path) -> None:
    store = Store(tmp_path)
    last = made(store, "evaluation")
    assert newest_whole(store, "town")["version"] == last.name
    whole = made(store, "evaluation", "evaluation_fold1", nvs={})
    made(store, "evaluation")
    assert newest_whole(store, "town")["version"] == whole.name


def test_after_a_run_that_ended_early_the_scene_still_knows_what_it_was_made_of(tmp_path: Path) -> None:
    store = Store(tmp_path)
    assert records_before(store, "town") == {}
    steps = ("photos", "sfm", "training")
    for run in ("old", "whole", "early"):
        for step in steps[: 1 if run == "early" else 3]:
            store.commit(files_of(store, step, run), step, run, MADE)
        made(store, *steps[: 1 if run == "early" else 3], key=run, **({} if run == "early" else {"nvs": {}}))
    assert {step: record.key for step, record in records_before(store, "town").items()} == {
        "photos": "early",
        "sfm": "whole",
        "training": "whole",
    }
    publish(store, versions(store, "town")[0])
    assert {record.key for record in records_before(store, "town").values()} == {"old"}


@pytest.mark.parametrize("ending", layout.SCENE_FILES)
def test_a_registered_scene_without_a_version_is_told_from_one_that_nobody_knows(tmp_path: Path, ending: str) -> None:
    store = Store(tmp_path)
    (tmp_path / layout.SCENES / f"hill{ending}").touch()
    with pytest.raises(UsageError, match=r"'hill' is registered .*was never run") as told:
        last_version(store, "hill")
    assert "aug3d run hill" in told.value.remedy
    with pytest.raises(UsageError, match="there is no scene 'dale'"):
        last_version(store, "dale")
