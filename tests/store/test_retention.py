"""What a kept version or a study names stays whole; all else goes, and a deletion that is cut short leaves nothing half."""

from __future__ import annotations

import json
import shutil
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.run.files import FILES, JOB, LOG
from aug3d_core.store import layout, retention
from aug3d_core.store.published import publish, published
from aug3d_core.store.retention import drop, plan, plan_for_scene
from aug3d_core.store.store import Store
from aug3d_core.store.usage import objects_of, studies, versions
from tests.store.little_store import add_collection_version, add_object, add_study, add_version, make_old

KEYS = [("photos", "a"), ("sfm", "b"), ("sfm", "c"), ("training", "d"), ("training", "e"), ("dataset", "f")]
some_objects = st.lists(st.sampled_from(KEYS), max_size=4, unique=True)
a_version = st.tuples(st.sampled_from(["one", "two"]), some_objects, st.booleans())


def there(store: Store) -> set[tuple[str, str]]:
    return {item for item in KEYS if store.find(*item) is not None}


def collect(store: Store, keep: int = 3, keep_hours: float = 0.0) -> None:
    with store.alone():
        drop(store, plan(store, keep, keep_hours).goes)


def five_versions(store: Store) -> list[Path]:
    for item in KEYS[:5]:
        add_object(store, *item)
    return [add_version(store, "demo", f"2026-0{i + 1}", [item]) for i, item in enumerate(KEYS[:5])]


@given(history=st.lists(a_version, max_size=6), studied=some_objects, keep=st.integers(1, 4))
def test_exactly_what_is_named_by_what_is_kept_stays(history, studied, keep: int) -> None:
    with tempfile.TemporaryDirectory() as home:
        store = Store(Path(home))
        for item in KEYS:
            add_object(store, *item)
        made = [add_version(store, scene, f"{i}", objects, bad) for i, (scene, objects, bad) in enumerate(history)]
        add_study(store, "one", "grouping-1", studied)
        collect(store, keep)
        assert there(store) == objects_of([*versions(store), *studies(store)])
        for scene in ("one", "two"):
            mine = [(folder, bad) for folder, (name, _, bad) in zip(made, history, strict=True) if name == scene]
            good = [folder for folder, bad in mine if not bad]
            left = [folder for folder, _ in mine if folder.exists()]
            assert set(left) == {folder for folder, _ in mine[-keep:]} | set(good[-1:])
        assert plan(store, keep, 0.0).goes == (), "once is enough"


def test_the_published_version_stays_however_old(tmp_path: Path) -> None:
    store = Store(tmp_path)
    folders = five_versions(store)
    publish(store, folders[0])
    collect(store, keep=1)
    assert [folder.exists() for folder in folders] == [True, False, False, False, True]
    assert there(store) == {KEYS[0], KEYS[4]}


def test_a_collection_keeps_its_newest_and_its_published_versions_as_a_scene_does(tmp_path: Path) -> None:
    store = Store(tmp_path)
    for item in KEYS[:5]:
        add_object(store, *item)
    folders = [add_collection_version(store, "demo", f"{i}", [item]) for i, item in enumerate(KEYS[:5])]
    publish(store, folders[0])
    add_version(store, "demo", "1", [])  # a scene of that name has a life of its own
    collect(store, keep=2)
    assert there(store) == {KEYS[0], KEYS[3], KEYS[4]}
    assert published(store, "demo", layout.COLLECTIONS) == folders[0] and published(store, "demo") is None
    with store.alone():
        drop(store, plan_for_scene(store, "demo").goes)
    assert published(store, "demo", layout.COLLECTIONS) is None and not there(store)


def test_failed_runs_do_not_push_out_the_last_good_version(tmp_path: Path) -> None:
    store = Store(tmp_path)
    add_object(store, *KEYS[0])
    good = add_version(store, "demo", "1", [KEYS[0]])
    for i in range(2, 7):
        add_version(store, "demo", str(i), [], failed=True)
    collect(store, keep=3)
    assert good.exists() and there(store) == {KEYS[0]} and len(versions(store)) == 4


def test_versions_that_mlflow_is_still_to_be_told_of_stay(tmp_path: Path) -> None:
    store = Store(tmp_path)
    folders = five_versions(store)
    outbox = store.root / layout.MLFLOW_OUTBOX
    outbox.mkdir()
    (outbox / "1 demo.json").write_text(json.dumps({"scene": "demo", "version": folders[1].name, "publish": False}))
    (outbox / "2 demo.json").write_text("no entry")
    collect(store, keep=1)
    assert [folder.exists() for folder in folders] == [False, True, False, False, True]
    assert there(store) == {KEYS[1], KEYS[4]}


def test_what_a_killed_run_may_go_on_from_stays_for_its_hours(tmp_path: Path) -> None:
    store = Store(tmp_path)
    add_object(store, *KEYS[0])
    work, failure = store.work_dir("sfm", "w"), store.failure_dir("sfm", "f")
    for folder in (work, failure):
        folder.mkdir(parents=True)
        (folder / JOB).write_text("{}")
    collect(store, keep_hours=24)
    assert there(store) == {KEYS[0]} and work.exists() and failure.exists()
    assert len(plan(store, 3, 24).young) == 3
    for folder in (store.object_dir(*KEYS[0]), work, failure):
        make_old(folder)
    (work / LOG).write_text("it was touched again")
    collect(store, keep_hours=24)
    assert not there(store) and not failure.exists() and work.exists()
    collect(store, keep_hours=0)
    assert not work.exists()


def test_objects_of_dropped_versions_go_however_young(tmp_path: Path) -> None:
    store = Store(tmp_path)
    five_versions(store)
    collect(store, keep=1, keep_hours=24)
    assert there(store) == {KEYS[4]}


def test_work_that_someone_does_stays(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.work_dir("sfm", "w").mkdir(parents=True)
    with store.lock("sfm", "w"):
        assert plan(store, 3, 0.0).goes == ()
    assert [waste.what for waste in plan(store, 3, 0.0).goes] == [retention.WORK]


def test_an_object_that_someone_makes_after_all_stays(tmp_path: Path) -> None:
    store = Store(tmp_path)
    add_object(store, *KEYS[0])
    goes = plan(store, 3, 0.0).goes
    with store.lock(*KEYS[0]), pytest.raises(StoreError, match="another process is making photos a"):
        drop(store, goes)
    assert there(store) == {KEYS[0]}


def test_a_version_whose_run_was_killed_before_it_counted_goes(tmp_path: Path) -> None:
    store = Store(tmp_path)
    add_version(store, "demo", "1", [])
    half = store.root / layout.SCENES / "demo" / "2"
    half.mkdir()
    (half / layout.REPORT).write_text("half a report")
    collect(store)
    assert [version.folder.name for version in versions(store)] == ["1"] and not half.exists()


def test_all_of_a_scene_goes_but_what_others_need(tmp_path: Path) -> None:
    store = Store(tmp_path)
    for item in KEYS[:4]:
        add_object(store, *item)
    publish(store, add_version(store, "demo", "1", KEYS[:2]))
    add_study(store, "demo", "grouping-1", [KEYS[2]])
    add_version(store, "other", "1", [KEYS[1]])
    with store.alone():
        drop(store, plan_for_scene(store, "demo").goes)
    assert there(store) == {KEYS[1], KEYS[3]}, "what no scene names is not this scene's"
    assert [path.name for path in (store.root / layout.SCENES).iterdir()] == ["other"]
    assert not (store.root / layout.STUDIES / "demo").exists()


def test_a_scene_that_is_not_there_is_named(tmp_path: Path) -> None:
    store = Store(tmp_path)
    add_version(store, "demo", "1", [])
    with pytest.raises(UsageError, match=r"nothing of a scene 'dmeo'.*\n.*demo"):
        plan_for_scene(store, "dmeo")


def test_nothing_goes_while_a_version_cannot_be_read(tmp_path: Path) -> None:
    store = Store(tmp_path)
    (five_versions(store)[2] / layout.METRICS).write_text("{")
    with pytest.raises(StoreError, match="does not say which objects"):
        collect(store, keep=1)
    assert there(store) == set(KEYS[:5])


def test_runs_that_come_and_go_never_lose_what_they_found(tmp_path: Path) -> None:
    store = Store(tmp_path)
    lost: list[str] = []
    made: list[str] = []

    def run(key: str) -> None:
        for _ in range(20):
            with store.using():
                with store.lock("sfm", key):
                    if store.find("sfm", key) is None:
                        add_object(store, "sfm", key)
                        made.append(key)
                time.sleep(0.002)
                if not (store.object_dir("sfm", key) / FILES / "small").exists():
                    lost.append(key)
            time.sleep(0.005)

    runs = [threading.Thread(target=run, args=(key,)) for key in ("a", "a", "b")]
    for one in runs:
        one.start()
    while any(one.is_alive() for one in runs):
        with suppress(StoreError):
            collect(store)
    assert not lost and len(made) > 2, "some were dropped, and made again"


def test_a_disk_that_is_full_to_the_last_byte_can_be_cleared(small_disk: Callable[[int], Path]) -> None:
    store = Store(small_disk(8))
    add_object(store, *KEYS[0], size_bytes=2**20)
    store.work_dir("sfm", "w").mkdir(parents=True)
    with suppress(OSError), (store.root / "something").open("wb", buffering=0) as file:
        while file.write(bytes(4096)):
            pass
    assert shutil.disk_usage(store.root).free == 0
    collect(store)
    assert shutil.disk_usage(store.root).free >= 2**20 and plan(store, 3, 0.0).goes == ()


class Killed(BaseException):
    """Stands for SIGKILL."""


@pytest.mark.parametrize("deletions", range(9))
def test_a_deletion_that_is_killed_anywhere_leaves_nothing_that_looks_whole(
    deletions: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(tmp_path)
    five_versions(store)
    (store.failure_dir("sfm", "f") / FILES).mkdir(parents=True)
    delete, done = shutil.rmtree, 0

    def killed_half_way(folder: Path, **_: object) -> None:
        nonlocal done
        if done == deletions:
            for file in sorted(path for path in Path(folder).rglob("*") if path.is_file())[-1:]:
                file.unlink()
            raise Killed
        done += 1
        delete(folder)

    monkeypatch.setattr(shutil, "rmtree", killed_half_way)
    with pytest.raises(Killed):
        collect(store, keep=1)
    monkeypatch.undo()
    assert objects_of(versions(store)) <= there(store), "what counts is whole"
    assert all((files / "small").exists() for files in store.made_by("sfm", "r1", 8)), "so is what is handed on"
    assert plan(store, 1, 0.0).goes
    collect(store, keep=1)
    assert there(store) == {KEYS[4]} and plan(store, 1, 0.0).goes == ()
    assert not [path for path in store.root.rglob("*") if path.name.startswith(layout.GONE)]
