"""What a version tells of places is safe to keep and to show."""

from __future__ import annotations

import pytest

from aug3d_core.store.scenes import masked, step_objects


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
