"""`aug3d verify` reads a store, names what is damaged, and makes it again."""

from __future__ import annotations

import json
from pathlib import Path
from unittest.mock import ANY

import pytest
from typer.testing import CliRunner

from aug3d_core.heads.files import MODEL_WEIGHTS
from aug3d_core.store import layout
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.published import publish, published
from aug3d_core.store.record import Record
from aug3d_core.store.retention import REMAINS, drop, plan
from aug3d_core.store.scenes import versions
from aug3d_core.store.store import Store
from flows.cli import app
from tests.store.little_store import add_version
from tests.store.test_verification import an_object
from tests.tests_support import flip


def verified(home: Path, *words: str) -> tuple[int, dict]:
    result = CliRunner().invoke(app, ["verify", *words, "--home", str(home), "--json"])
    return result.exit_code, json.loads(result.stdout)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    store = Store(tmp_path)
    an_object(store, "a")
    an_object(store, "b")
    return store


def test_a_whole_store(store: Store) -> None:
    code, told = verified(store.root)
    assert code == 0
    assert told["objects"] == 2 and told["bytes"] > 40 and told["damaged"] == []


def test_damage_is_named_and_changes_nothing_without_repair(store: Store) -> None:
    flip(store.object_dir("sfm", "a") / "files" / "b.bin", 17)
    for _ in range(2):
        code, told = verified(store.root)
        assert code == 3
        (damage,) = told["damaged"]
        assert damage["item"] == ["sfm", "a"] and damage["what"] == "b.bin holds other bytes than were written"
        assert damage["repaired"] is None


def test_what_cannot_be_made_again_is_put_aside_and_said(store: Store) -> None:
    flip(store.object_dir("sfm", "a") / "files" / "b.bin", 17)
    code, told = verified(store.root, "--repair")
    assert code == 3 and told["damaged"][0]["repaired"] is False
    code, told = verified(store.root)
    assert code == 0 and told["objects"] == 1


def test_a_damaged_version_is_put_aside_once_and_nothing_stumbles_over_it(store: Store) -> None:
    whole, bad = (add_version(store, "hill", name, [("sfm", "a")]) for name in ("1", "2"))
    publish(store, bad)
    (bad / layout.METRICS).write_text("{")
    code, told = verified(store.root, "--repair")
    assert code == 0 and [line["repaired"] for line in told["damaged"]] == [True]
    assert verified(store.root) == (0, told | {"damaged": [], "seconds": ANY})
    assert versions(store, "hill") == [whole] and published(store, "hill") is None
    goes = plan(store, 3, 0.0).goes
    assert {waste.folder.name.partition("-")[0] for waste in goes if waste.what == REMAINS} == {".damaged"}
    with store.alone():
        drop(store, goes)
    assert [path.name for path in (store.root / "scenes" / "hill").iterdir()] == ["1"]


def test_a_damaged_pointer_goes_with_the_rest(store: Store) -> None:
    pointer = add_version(store, "hill", "1", [("sfm", "a")]).parent / layout.PUBLISHED
    pointer.write_text("{")
    assert verified(store.root, "--repair")[0] == verified(store.root)[0] == 0
    assert published(store, "hill") is None
    with store.alone():
        drop(store, plan(store, 3, 0.0).goes)
    assert [path.name for path in pointer.parent.iterdir()] == ["1"]


def test_a_scene_that_is_not_there_is_refused(store: Store) -> None:
    result = CliRunner().invoke(app, ["verify", "vale", "--home", str(store.root)])
    assert result.exit_code == 2 and "no version or study of 'vale'" in result.output


def test_the_shipped_weights_are_read(store: Store, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "shipped").mkdir()
    (tmp_path / "shipped" / MODEL_WEIGHTS).write_bytes(b"other")
    monkeypatch.setattr("aug3d_core.heads.config.shipped", lambda: (tmp_path / "shipped", "0" * 64, ()))
    code, told = verified(store.root)
    assert code == 3 and "is not what aug3d ships" in told["damaged"][0]["what"]


def test_a_shared_store_is_read_and_repaired_by_a_machine_that_made_nothing(tmp_path: Path, shared: str) -> None:
    maker, other, place = Store(tmp_path / "maker"), tmp_path / "other", Bucket(shared)
    record = maker.record(*an_object(maker, "a"))
    assert isinstance(record, Record)
    code, told = verified(other)
    assert (code, told["objects"], told["shared"]["objects"], told["shared"]["bytes"]) == (0, 0, 1, 20)
    place.put(f"blobs/{record.files['a.bin'].sha256}", b"0123456780")
    code, told = verified(other)
    [damage] = told["shared"]["damaged"]
    assert code == 3 and damage["path"].startswith(f"{shared}/blobs/") and "other bytes" in damage["what"]
    code, told = verified(other, "--repair")
    assert code == 0 and told["shared"]["damaged"][0]["repaired"]
    assert verified(other)[1]["shared"] | {"seconds": 0} == {"objects": 0, "bytes": 0, "seconds": 0, "damaged": []}
