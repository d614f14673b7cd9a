"""What a version tells of places is safe to keep and to show."""

from __future__ import annotations

from pathlib import Path

import pytest

from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.store import layout
from aug3d_core.store.scenes import (
    damaged_versions,
    last_version,
    masked,
    new_version,
    scenes,
    step_objects,
    version_metrics,
    versions,
    write_metrics,
)
from aug3d_core.store.store import Store


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
