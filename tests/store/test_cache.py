"""A home keeps within its bound what the shared store has too: what was used last, and never what only it has."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from aug3d_core.run.errors import UsageError
from aug3d_core.run.files import FILES
from aug3d_core.run.limits import CACHE
from aug3d_core.store import layout
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.store import Store
from tests.store.little_store import add_object

MIB = 2**20
KEYS = ("a", "b", "c")


def here(store: Store) -> str:
    return "".join(key for key in KEYS if (store.object_dir("sfm", key) / FILES / "sub" / "big").exists())


@pytest.fixture
def store(tmp_path: Path, shared: str, monkeypatch: pytest.MonkeyPatch) -> Store:
    """Return a store of three objects of a MiB each, a used last, that may keep two and a half of them."""
    monkeypatch.setenv(CACHE, str(2.5 / 1024))
    store = Store(tmp_path / "home")
    for age, key in enumerate(KEYS, start=1):
        add_object(store, "sfm", key, MIB)
        os.utime(store.object_dir("sfm", key) / ".shared", (1e9 - age, 1e9 - age))
    return store


def test_what_was_not_used_for_longest_goes_and_comes_again(store: Store) -> None:
    with store.using():
        assert here(store) == "abc", "nothing goes while it may be read"
    assert here(store) == "ab"
    record = store.find("sfm", "c")
    assert record and store.whole("sfm", "c") == record, "its record stays"
    with store.using():
        assert (store.files_dir(record) / "sub" / "big").read_bytes() == bytes(MIB)
        assert here(store) == "abc"
    assert here(store) == "ac"


def test_nothing_goes_while_another_run_uses_the_home(store: Store) -> None:
    with Store(store.root).using():
        with store.using():
            pass
        assert here(store) == "abc"
    assert here(store) == "ab"


def test_what_the_shared_store_has_not_or_has_otherwise_stays(store: Store, shared: str) -> None:
    place = Bucket(shared)
    place.delete([f"objects/sfm/c/{layout.RECORD}"])
    place.put(f"objects/sfm/b/{layout.RECORD}", b"another machine's")
    (store.object_dir("sfm", "a") / ".shared").unlink()
    add_object(store, "sfm", "d", 4 * MIB)
    with store.using():
        pass
    assert here(store) == "abc" and not (store.object_dir("sfm", "d") / FILES).exists()


def test_without_a_shared_store_nothing_ever_goes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(CACHE, "0.0001")
    store = Store(tmp_path)
    add_object(store, "sfm", "a", MIB)
    with store.using():
        pass
    assert here(store) == "a"


def test_what_is_only_partly_here_is_not_handed_on_to_be_grown(store: Store) -> None:
    with store.using():
        assert {path.parent.name for path in store.made_by("sfm", "r1", 8)} == set(KEYS)
    assert {path.parent.name for path in store.made_by("sfm", "r1", 8)} == {"a", "b"}


def test_a_wrong_bound_is_told_before_anything_is_done(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(CACHE, "much")
    with pytest.raises(UsageError, match=CACHE):
        Store(store.root)
