"""Everything with a digest is read, and what is damaged is named with who needs it."""

from __future__ import annotations

from pathlib import Path

import pytest

from aug3d_core.run.files import JOB
from aug3d_core.store import layout
from aug3d_core.store.published import publish
from aug3d_core.store.scenes import new_version, write_metrics
from aug3d_core.store.seal import sealed
from aug3d_core.store.store import Store
from aug3d_core.store.verification import damaged, items_of, size_of
from tests.stand_in_stages import EMPTY
from tests.tests_support import flip


def an_object(store: Store, key: str, content: bytes = b"0123456789") -> tuple[str, str]:
    work = store.work_dir("sfm", key)
    (work / "files").mkdir(parents=True)
    (work / "files" / "a.bin").write_bytes(content)
    (work / "files" / "b.bin").write_bytes(content[::-1])
    (work / JOB).write_bytes(sealed({"stage": "sfm"}))
    fields = {"metrics": {}, "config": {}, "state": "ok", "seconds": 1.0, "cpu_seconds": 1.0}
    store.commit(work, "sfm", key, EMPTY | fields)
    return "sfm", key


@pytest.fixture
def store(tmp_path: Path) -> Store:
    store = Store(tmp_path)
    stage, key = an_object(store, "needed")
    an_object(store, "loose")
    version = new_version(store, "hill")
    (version / layout.REPORT).write_text("a report")
    write_metrics(version, {"scene": "hill", "objects": {"sfm": {"stage": stage, "key": key}}})
    publish(store, version)
    return store


def found(store: Store, scene: str | None = None):
    return list(damaged(store, scene, items_of(store, scene), lambda count: None))


def test_a_whole_store_has_no_damage_and_all_of_it_is_read(store: Store) -> None:
    read: list[int] = []
    items = items_of(store, None)
    assert items == [("sfm", "loose"), ("sfm", "needed")]
    assert list(damaged(store, None, items, read.append)) == []
    assert sum(read) == 4 * 10 <= size_of(store, items)
    assert items_of(store, "hill") == [("sfm", "needed")] and items_of(store, "vale") == []


def test_one_bit_in_any_file_of_an_object_is_found_and_its_version_named(store: Store) -> None:
    folder = store.object_dir("sfm", "needed")
    for file in sorted(path for path in folder.rglob("*") if path.is_file()):
        before = file.read_bytes()
        for bit in (0, 8 * len(before) // 2):
            flip(file, bit)
            (damage,) = found(store)
            assert damage.item == ("sfm", "needed") and file.name in damage.what
            assert damage.needed_by == tuple(
                path.parent.relative_to(store.root).as_posix() for path in store.root.glob("scenes/*/*/metrics.json")
            )
            file.write_bytes(before)
    assert found(store) == []


@pytest.mark.parametrize("name", [layout.METRICS, layout.REPORT])
def test_a_version_is_read_too(store: Store, name: str) -> None:
    (file,) = store.root.glob(f"scenes/hill/*/{name}")
    flip(file, 8 * 5)
    (damage,) = found(store)
    assert damage.path == file.parent and damage.item is None


def test_an_empty_version_and_a_pointer_to_nothing_are_named(store: Store) -> None:
    (file,) = store.root.glob("scenes/hill/*/metrics.json")
    file.write_bytes(b"")
    pointer = store.root / "scenes" / "hill" / layout.PUBLISHED
    pointer.write_bytes(b"{")
    assert [damage.path for damage in found(store)] == [file.parent, pointer]


def test_a_scene_alone_is_read(store: Store) -> None:
    flip(store.object_dir("sfm", "loose") / "files" / "a.bin", 3)
    assert found(store, "hill") == []
    assert len(found(store)) == 1
