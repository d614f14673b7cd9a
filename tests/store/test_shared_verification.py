"""Damage in a shared store is found by reading all of it, and ends with whole bytes or with none."""

from __future__ import annotations

from pathlib import Path

import pytest

from aug3d_core.store.bucket import Bucket
from aug3d_core.store.census import census
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import share_version
from aug3d_core.store.shared_verification import SharedDamage, damaged_there, readable, repair_there
from aug3d_core.store.store import Store
from tests.store.little_store import add_object, add_version

ITEMS = [("sfm", "a"), ("sfm", "b")]


@pytest.fixture
def maker(tmp_path: Path, shared: str) -> Store:
    store = Store(tmp_path / "maker")
    for item in ITEMS:
        add_object(store, *item)
    share_version(store, add_version(store, "hill", "1", ITEMS[:1]), ITEMS[:1])
    return store


@pytest.fixture
def other(tmp_path: Path, maker: Store) -> Store:
    """Return the store of a machine that made nothing, and knows the records."""
    store = Store(tmp_path / "other")
    assert all(store.find(*item) for item in ITEMS)
    return store


@pytest.fixture
def place(shared: str) -> Bucket:
    return Bucket(shared)


def found(place: Bucket, scene: str | None = None) -> list[SharedDamage]:
    return list(damaged_there(place, readable(census(place, None), scene), lambda count: None))


def repair(store: Store, place: Bucket) -> list[str]:
    seen = readable(census(place, None), None)
    return [repair_there(store, seen, one) for one in damaged_there(place, seen, lambda count: None)]


def blob(store: Store, name: str = "small", item: tuple[str, str] = ITEMS[0]) -> str:
    record = store.record(*item)
    assert isinstance(record, Record)
    return f"blobs/{record.files[name].sha256}"


def test_a_whole_store_has_no_damage_and_each_byte_is_read_once(maker: Store, place: Bucket) -> None:
    read: list[int] = []
    seen = readable(census(place, None), None)
    assert list(damaged_there(place, seen, read.append)) == []
    assert sum(read) == seen.size_bytes == 1000 + 1 + 1, "what two objects have in common is there once"
    assert set(readable(census(place, None), "hill").records) == {ITEMS[0]}


@pytest.mark.parametrize("content", [b"x", b"longer", None])
def test_bytes_that_are_others_or_gone_are_named_with_who_needs_them(
    content: bytes | None, maker: Store, place: Bucket
) -> None:
    name = blob(maker)
    place.delete([name]) if content is None else place.put(name, content)
    [damage] = found(place)
    assert (damage.name, damage.items, damage.needed_by) == (name, (ITEMS[0],), ("scenes/hill/1",))
    assert damage.what == ("is missing" if content is None else "holds other bytes than were written")
    assert found(place, "hill") == [damage] and found(place, "vale") == []


def test_a_machine_that_has_the_bytes_puts_them_again(maker: Store, other: Store, place: Bucket) -> None:
    place.put(blob(maker), b"x")
    assert repair(maker, place) == ["put again: this machine has it"]
    assert found(place) == []
    record = other.record(*ITEMS[0])
    assert isinstance(record, Record) and other.file(record, "small").read_text() == "a"


def test_another_machine_deletes_what_names_them_and_the_next_run_makes_it(
    maker: Store, other: Store, place: Bucket
) -> None:
    place.put(blob(maker, "sub/big"), b"x")  # of both objects
    [said] = repair(other, place)
    assert "sfm a, sfm b: run the scene again" in said
    assert found(place) == [] and other.find(*ITEMS[0]) is None
    made = add_object(other, *ITEMS[0])
    assert place.has("objects/sfm/a/record.json") and (other.files_dir(made) / "small").read_text() == "a"


def test_what_a_repair_deleted_its_maker_gives_again_when_it_uses_it(maker: Store, other: Store, place: Bucket) -> None:
    place.put(blob(maker), b"x")
    repair(other, place)
    share_version(maker, add_version(maker, "hill", "2", ITEMS[:1]), ITEMS[:1])
    assert found(place) == [] and other.find(*ITEMS[0])


@pytest.mark.parametrize(
    "name", ["objects/sfm/a/record.json", "scenes/hill/1/metrics.json", "scenes/hill/published.json"]
)
def test_a_damaged_record_version_or_pointer_is_found_and_deleted(name: str, other: Store, place: Bucket) -> None:
    place.put(name, b"{")
    assert [one.name for one in found(place)] == [name]
    assert len(repair(other, place)) == 1
    assert not place.has(name) and found(place) == []
