"""Every byte of an object is counted once, and told as a scene's own or as shared."""

from __future__ import annotations

from pathlib import Path

import pytest

from aug3d_core.run.errors import StoreError
from aug3d_core.store import layout
from aug3d_core.store.store import Store
from aug3d_core.store.usage import besides, bytes_under, usage
from tests.store.little_store import add_object, add_study, add_version


def size(store: Store, *objects: tuple[str, str]) -> int:
    return sum(bytes_under(store.object_dir(*item)) for item in objects)


def test_what_two_versions_of_a_scene_need_is_its_own_and_counted_once(tmp_path: Path) -> None:
    store, photos, old, new = Store(tmp_path), ("photos", "a"), ("sfm", "b"), ("sfm", "c")
    for stage, key in (photos, old, new):
        add_object(store, stage, key)
    folders = [add_version(store, "demo", "1", [photos, old]), add_version(store, "demo", "2", [photos, new])]
    used = usage(store)["demo"]
    assert used.own_bytes == size(store, photos, old, new) + sum(map(bytes_under, folders))
    assert (used.versions, used.studies, used.shared_bytes) == (2, 0, 0)


def test_what_two_scenes_need_is_told_as_shared_by_both(tmp_path: Path) -> None:
    store, shared, own = Store(tmp_path), ("photos", "a"), ("sfm", "b")
    for stage, key in (shared, own):
        add_object(store, stage, key, 5000)
    one, two = add_version(store, "one", "1", [shared, own]), add_version(store, "two", "1", [shared])
    used = usage(store)
    assert used["one"].shared_bytes == used["two"].shared_bytes == size(store, shared)
    assert used["one"].own_bytes == size(store, own) + bytes_under(one)
    assert used["two"].own_bytes == bytes_under(two)


def test_a_study_is_its_scenes(tmp_path: Path) -> None:
    store, cell = Store(tmp_path), ("training", "a")
    add_object(store, *cell)
    add_version(store, "demo", "1", [])
    add_study(store, "demo", "grouping-1", [cell])
    used = usage(store)["demo"]
    assert used.studies == 1 and used.own_bytes > size(store, cell)


def test_an_object_that_is_gone_counts_nothing(tmp_path: Path) -> None:
    folder = add_version(Store(tmp_path), "demo", "1", [("sfm", "gone")])
    assert usage(Store(tmp_path))["demo"].own_bytes == bytes_under(folder)


def test_what_is_no_scenes_is_told_besides(tmp_path: Path) -> None:
    store = Store(tmp_path)
    for name, size_bytes in (
        (layout.MLFLOW_DATABASE, 10),
        (f"{layout.BENCH}/views/kept", 20),
        (f"{layout.WORK}/w", 30),
    ):
        (store.root / name).parent.mkdir(parents=True, exist_ok=True)
        (store.root / name).write_bytes(bytes(size_bytes))
    told = besides(store)
    assert (told["MLflow"], told["benchmarks"], told["unfinished work"], told["Prefect"]) == (10, 20, 30, 0)


def test_links_and_what_they_lead_to_do_not_count(tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    (tmp_path / "far" / "big").write_bytes(bytes(10**6))
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "link").symlink_to(tmp_path / "far")
    assert bytes_under(tmp_path / "here") < 1000


@pytest.mark.parametrize(
    "content",
    [
        "{",
        "[]",
        "{}",
        '{"objects": [1]}',
        '{"objects": {"sfm": 1}}',
        '{"objects": {"sfm": {"stage": "sfm"}}}',
        '{"paths": {"objects": [1]}}',
        '{"paths": {"objects": {"sfm": 1}}}',
    ],
)
def test_a_version_that_cannot_be_read_is_named(content: str, tmp_path: Path) -> None:
    store = Store(tmp_path)
    metrics = add_version(store, "demo", "1", []) / layout.METRICS
    metrics.write_text(content)
    with pytest.raises(
        StoreError,
        match=r"metrics\.json does not say which objects.*\n.*verify --repair",
    ) as caught:
        usage(store)
    assert str(metrics) in caught.value.problem


def test_a_study_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    store = Store(tmp_path)
    (add_study(store, "demo", "grouping-1", []) / layout.STUDY_FINDINGS).write_text(
        '{"cells": [{}], "objects": [["sfm"]]}'
    )
    with pytest.raises(StoreError, match=r"study\.json does not say"):
        usage(store)
