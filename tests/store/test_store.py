"""Objects are whole or absent, and altered ones are seen."""

from __future__ import annotations

import errno
import json
import multiprocessing
import os
import threading
import time
from pathlib import Path

import pytest

from aug3d_core.run.errors import StoreError
from aug3d_core.run.files import FILES, LOG
from aug3d_core.store import layout
from aug3d_core.store.damage import DamagedError
from aug3d_core.store.record import Record
from aug3d_core.store.seal import SEAL, sealed
from aug3d_core.store.store import Store
from tests.tests_support import flip

pytestmark = pytest.mark.usefixtures("either")

FIELDS = {
    "recipe": "r1",
    "config": {},
    "inputs": {},
    "versions": {},
    "metrics": {"figure": 1.0},
    "state": "ok",
    "notes": (),
    "series": {},
    "pictures": {},
    "seconds": 1.0,
    "peak_mib": 2.0,
}


def commit(store: Store, content: str = "hello", key: str = "k1") -> Record:
    work = store.work_dir("photos", key)
    (work / FILES / "sub").mkdir(parents=True)
    (work / FILES / "sub" / "a.txt").write_text(content)
    (work / LOG).write_text("a log does not count")
    return store.commit(work, "photos", key, dict(FIELDS))


def test_what_is_committed_is_found(tmp_path: Path) -> None:
    store = Store(tmp_path)
    record = commit(store)
    assert store.find("photos", "k1") == record
    assert (store.files_dir(record) / "sub" / "a.txt").read_text() == "hello"
    assert not store.work_dir("photos", "k1").exists()


def test_digest_depends_on_paths_and_bytes_alone(tmp_path: Path) -> None:
    store = Store(tmp_path)
    one, same, other = commit(store, "x", "k1"), commit(store, "x", "k2"), commit(store, "y", "k3")
    assert one.digest == same.digest != other.digest


def test_a_missing_object_is_not_found(tmp_path: Path) -> None:
    assert Store(tmp_path).find("photos", "nothing") is None


@pytest.mark.parametrize("harm", ["alter", "alter_same_size", "delete", "no_record", "half_record"])
def test_a_harmed_object_is_not_found_and_stays_until_its_maker_drops_it(tmp_path: Path, harm: str) -> None:
    store = Store(tmp_path)
    record = commit(store)
    file = store.files_dir(record) / "sub" / "a.txt"
    record_file = store.object_dir("photos", "k1") / layout.RECORD
    if harm == "alter":
        file.write_text("hello, changed")
    elif harm == "alter_same_size":
        time.sleep(0.01)
        file.write_text("hellO")
    elif harm == "delete":
        file.unlink()
    elif harm == "no_record":
        record_file.unlink()
    else:
        record_file.write_text(record_file.read_text()[:50])
    if harm == "delete" and store.shared:
        assert store.find("photos", "k1") == record and (store.files_dir(record) / "sub" / "a.txt").exists()
        return
    held = sorted(store.object_dir("photos", "k1").rglob("*"))
    assert store.find("photos", "k1") is None
    assert sorted(store.object_dir("photos", "k1").rglob("*")) == held, "whoever only looks deletes nothing"
    found, wrong = store.take("photos", "k1")
    assert wrong.startswith("record.json" if "record" in harm else "sub/a.txt") and (found is None) == (
        "record" in harm
    )
    assert commit(store).digest == record.digest  # and it can be made again
    (aside,) = (tmp_path / layout.OBJECTS / "photos").glob(f"{layout.DAMAGED}k1-*")
    assert aside.is_dir(), "what was damaged can be looked at"


def test_a_record_of_a_newer_version_is_read(tmp_path: Path) -> None:
    store = Store(tmp_path)
    record = commit(store)
    file = store.object_dir("photos", "k1") / layout.RECORD
    told = json.loads(file.read_text())
    told["files"]["sub/a.txt"]["mode"] = 0o644
    del told[SEAL]
    file.write_bytes(sealed(told | {"joules": 3.0}))
    assert store.find("photos", "k1") == record


def test_a_flipped_bit_is_seen_by_whoever_reads_and_the_object_goes_out_of_sight(tmp_path: Path) -> None:
    store = Store(tmp_path)
    record = commit(store)
    flip(store.place(record) / "sub" / "a.txt", 9)
    assert store.find("photos", "k1") == record, "a look alone reads no file"
    with pytest.raises(DamagedError, match=r"sub/a\.txt holds other bytes.*\n.*aug3d verify --repair") as caught:
        store.files_dir(record)
    again = store.find("photos", "k1")
    assert again == (record if store.shared else None), "where it is shared, it is brought again"
    assert caught.value.aside
    assert (caught.value.aside / FILES / "sub" / "a.txt").read_text() != "hello"


def test_only_what_is_read_is_checked_and_only_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(tmp_path)
    work = store.work_dir("photos", "k1") / FILES
    work.mkdir(parents=True)
    (work / "read").write_text("a")
    (work / "not read").write_text("b")
    record = store.commit(work.parent, "photos", "k1", dict(FIELDS))
    flip(store.place(record) / "not read", 0)
    assert store.files_dir(record, ["read"]) == store.place(record)
    monkeypatch.setattr("aug3d_core.store.damage.memoryview", lambda *_: pytest.fail("read twice"), raising=False)
    store.files_dir(record, ["read"])


def test_what_a_process_has_written_it_does_not_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(tmp_path)
    record = commit(store)
    monkeypatch.setattr("aug3d_core.store.damage.memoryview", lambda *_: pytest.fail("read again"), raising=False)
    assert store.files_dir(record) == store.place(record)


@pytest.mark.parametrize("where", ['"recipe": "r', '"figure": 1', '"sha256": "', '"seal": "'])
def test_a_record_with_a_flipped_bit_is_not_believed(tmp_path: Path, where: str) -> None:
    store = Store(tmp_path)
    commit(store)
    file = store.object_dir("photos", "k1") / layout.RECORD
    flip(file, 8 * (file.read_text().index(where) + len(where)))
    assert store.find("photos", "k1") is None
    assert store.take("photos", "k1")[1].startswith("record.json is damaged")


def test_a_record_of_an_older_version_has_no_seal_and_is_read(tmp_path: Path) -> None:
    store = Store(tmp_path)
    record = commit(store)
    file = store.object_dir("photos", "k1") / layout.RECORD
    file.write_text(record.model_dump_json())
    assert store.find("photos", "k1") == record
    flip(file, 8 * (file.read_text().index('"sha256":"') + 12))
    assert store.find("photos", "k1") is None, "the digest of the whole does not fit"


def test_a_disk_that_cannot_be_read_is_no_harmed_object(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(tmp_path)
    commit(store)
    stat = Path.stat

    def failing(path: Path, **how: bool) -> os.stat_result:
        if path.name == "a.txt":
            raise OSError(errno.EIO, os.strerror(errno.EIO), str(path))
        return stat(path, **how)

    monkeypatch.setattr(Path, "stat", failing)
    with pytest.raises(StoreError, match=r"a\.txt cannot be read: Input/output error\n.*try again"):
        store.find("photos", "k1")
    assert store.object_dir("photos", "k1").is_dir()


def test_a_touched_but_unaltered_file_is_still_whole(tmp_path: Path) -> None:
    store = Store(tmp_path)
    record = commit(store)
    (store.files_dir(record) / "sub" / "a.txt").touch()
    assert store.find("photos", "k1") == record


@pytest.mark.parametrize("resumable", [False, True])
def test_a_failure_that_a_full_disk_cannot_keep_stays_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, resumable: bool
) -> None:
    store = Store(tmp_path)
    work, mkdir = store.work_dir("photos", "k1"), Path.mkdir
    work.mkdir(parents=True)
    (work / LOG).write_text("the end")

    def full(path: Path, *how: object, **more: bool) -> None:
        if path.is_relative_to(tmp_path / layout.FAILURES):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        mkdir(path, *how, **more)

    monkeypatch.setattr(Path, "mkdir", full)
    assert store.keep_failure(work, "photos", "k1", resumable=resumable) == work
    assert (work / LOG).read_text() == "the end"


def test_a_work_folder_is_not_an_object(tmp_path: Path) -> None:
    store = Store(tmp_path)
    (store.work_dir("photos", "k1") / FILES).mkdir(parents=True)
    assert store.find("photos", "k1") is None


def _hold(root: Path, ready: multiprocessing.synchronize.Event) -> None:
    with Store(root).lock("photos", "k1"):
        ready.set()
        time.sleep(60)


def test_the_lock_keeps_others_out_and_ends_with_its_holder(tmp_path: Path) -> None:
    store = Store(tmp_path)
    context = multiprocessing.get_context("spawn")
    ready = context.Event()
    holder = context.Process(target=_hold, args=(tmp_path, ready))
    holder.start()
    assert ready.wait(60)
    with pytest.raises(StoreError, match="another process"), store.lock("photos", "k1", timeout_s=0.1):
        pass
    with store.lock("photos", "k2", timeout_s=0.1):
        pass
    holder.kill()
    holder.join()
    with store.lock("photos", "k1", timeout_s=5):
        pass


def _use(root: Path, ready: multiprocessing.synchronize.Event) -> None:
    with Store(root).using():
        ready.set()
        time.sleep(60)


def test_nothing_is_dropped_while_anyone_uses_the_store_until_the_last_of_them_ends(tmp_path: Path) -> None:
    store = Store(tmp_path)
    context = multiprocessing.get_context("spawn")
    ready = context.Event()
    user = context.Process(target=_use, args=(tmp_path, ready))
    user.start()
    assert ready.wait(60)
    with store.using(), pytest.raises(StoreError, match=r"is using the store.*\n.*wait"), store.alone():
        pass
    with pytest.raises(StoreError, match="is using the store"), store.alone():
        pass
    user.kill()
    user.join()
    with store.alone():
        pass


def test_whoever_comes_while_something_is_dropped_waits(tmp_path: Path) -> None:
    store, order = Store(tmp_path), []

    def use() -> None:
        with store.using():
            order.append("used")

    user = threading.Thread(target=use)
    with store.alone():
        user.start()
        user.join(0.3)
        order.append("dropped")
    user.join(10)
    assert order == ["dropped", "used"]


def test_an_object_that_is_half_deleted_is_not_handed_on(tmp_path: Path) -> None:
    store = Store(tmp_path)
    commit(store)
    store.object_dir("photos", "k1").rename(store.object_dir("photos", f"{layout.GONE}k1-1"))
    assert store.made_by("photos", "r1", most=8) == []


def test_turns_are_taken_one_at_a_time_and_the_wait_is_told(tmp_path: Path) -> None:
    store, told, order = Store(tmp_path), threading.Event(), []

    def second() -> None:
        with store.turn("training", lambda done, total, what: (order.append(what), told.set())):
            order.append("second")

    with store.turn("training", lambda *_: order.append("never told")), store.turn("rendering", print):
        other = threading.Thread(target=second)
        other.start()
        assert told.wait(10)
        order.append("first")
    other.join()
    assert order == ["waiting for another scene's training", "first", "second"]


def test_a_store_that_cannot_be_opened_says_so(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("not a folder")
    with pytest.raises(StoreError, match=r"cannot be opened.*\n.*--home"):
        Store(tmp_path / "file")


def test_a_store_that_cannot_even_be_read_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def closed(path: Path, *_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))

    monkeypatch.setattr(Path, "mkdir", closed)
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(StoreError, match=r"cannot be opened: Permission denied"):
        Store(tmp_path)


def test_a_record_survives_json(tmp_path: Path) -> None:
    record = commit(Store(tmp_path))
    assert Record.model_validate(json.loads(record.model_dump_json())) == record


def test_objects_of_a_recipe_are_found_newest_first(tmp_path: Path) -> None:
    store = Store(tmp_path)
    first, second = commit(store, "a", "k1"), commit(store, "b", "k2")
    os.utime(store.object_dir("photos", "k1") / layout.RECORD, ns=(10**18, 2 * 10**18))
    os.utime(store.object_dir("photos", "k2") / layout.RECORD, ns=(10**18, 10**18))
    assert store.made_by("photos", "r1", most=8) == [store.files_dir(first), store.files_dir(second)]
    assert store.made_by("photos", "r1", most=1) == [store.files_dir(first)]
    assert store.made_by("photos", "r1", 8, before=second) == [store.files_dir(second), store.files_dir(first)]
    assert store.made_by("photos", "another", most=8) == []


def test_a_home_that_no_address_can_name_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"has a '\?' in its path"):
        Store(tmp_path / "a?b")
    assert not any(tmp_path.iterdir())
    for name in ("c#d", "e%20f", "[g]", "h i"):
        assert Store(tmp_path / name).root.name == name
