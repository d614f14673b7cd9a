"""A step that is made again says why: its settings, engines, code or inputs differ, and only those."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from aug3d_core.factory.stages import PHOTOS, TRAINING
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.store.changes import why_made
from aug3d_core.store.record import FileEntry, Record
from aug3d_core.store.store import Store, file_entry

FIELDS = {
    "stage": "training", "key": "k", "digest": "d", "recipe": "r", "config": {"steps": 300, "seed": 0},
    "inputs": {"dataset": "1"}, "versions": {"torch": "2.6"}, "files": {}, "metrics": {}, "state": "ok", "notes": (),
    "series": {}, "pictures": {}, "seconds": 1.0, "peak_mib": 1.0,
}  # fmt: skip


def record(**changed: Any) -> Record:
    return Record.model_validate(FIELDS | changed)


@pytest.mark.parametrize(
    ("changed", "reasons"),
    [
        ({}, ()),
        ({"recipe": "s"}, ("code of aug3d",)),
        ({"recipe": "s", "config": {"steps": 500, "seed": 0}}, ("steps 300 -> 500",)),
        ({"recipe": "s", "config": {"steps": 300}}, ("seed 0 -> none",)),
        ({"recipe": "s", "versions": {"torch": "2.7"}}, ("torch 2.6 -> 2.7",)),
        ({"inputs": {"dataset": "2"}}, ("other dataset",)),
        ({"inputs": {"dataset": "1", "mesh_truth": "1"}}, ("other mesh truth",)),
        ({"recipe": "s", "inputs": {"dataset": "2"}}, ("code of aug3d", "other dataset")),
    ],
)
def test_reasons(changed: dict[str, Any], reasons: tuple[str, ...], tmp_path: Path) -> None:
    assert why_made(Store(tmp_path), TRAINING, record(**changed), record()) == reasons


def test_what_never_was_is_made_for_the_first_time(tmp_path: Path) -> None:
    assert why_made(Store(tmp_path), TRAINING, record(), None) == ("first time",)


def written(path: Path, rows: dict[str, str]) -> FileEntry:
    path.parent.mkdir(parents=True)
    pd.DataFrame({"name": rows.keys(), "sha256": rows.values()}).to_parquet(path)
    return file_entry(path)


@pytest.mark.parametrize(
    ("now", "told"),
    [
        ({"b": "2", "c": "4", "d": "5"}, "1 new: d; 1 gone: a; 1 altered: c"),
        ({"a": "1", "b": "2", "c": "3"}, "other files, the same photographs"),
        ({str(i): "x" for i in range(5)} | {"a": "1", "b": "2", "c": "3"}, "5 new: 0, 1, 2, ..."),
    ],
)
def test_photographs_that_came_went_and_changed_are_named(now: dict[str, str], told: str, tmp_path: Path) -> None:
    store = Store(tmp_path)
    first, second = (record(stage="photos", key=key, inputs={"folder": key}) for key in "12")
    for made, rows in ((first, {"a": "1", "b": "2", "c": "3"}), (second, now)):
        made.files[PHOTO_TABLE] = written(store.place(made) / PHOTO_TABLE, rows)
    assert why_made(store, PHOTOS, second, first) == (told,)
