"""Read everything in a shared store, name what is not what its digest says, and see that it is made again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

from aug3d_core.run.errors import StoreError
from aug3d_core.run.files import FILES
from aug3d_core.store import layout
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.census import COUNTS_BY, Census, record_names
from aug3d_core.store.damage import sha256_of
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from aug3d_core.store.usage import Holder, Object
from aug3d_core.store.verification import OnBytes

_TOGETHER = 8  # requests at once


@dataclass(frozen=True)
class SharedDamage:
    """What is damaged. name: in the bucket; items: the objects that name it; needed_by: versions and studies that need them."""

    name: str
    what: str
    items: tuple[Object, ...] = ()
    needed_by: tuple[str, ...] = ()


@dataclass(frozen=True)
class Readable:
    """What can be read of a shared store, of all of it or of what a scene's versions and studies name."""

    records: dict[Object, Record]
    holders: list[Holder]
    damage: list[SharedDamage]

    @property
    def blobs(self) -> dict[str, tuple[int, tuple[Object, ...]]]:
        """The size and the objects of each file's bytes, by SHA-256."""
        found: dict[str, tuple[int, tuple[Object, ...]]] = {}
        for item, record in self.records.items():
            for digest, size in {entry.sha256: entry.size_bytes for entry in record.files.values()}.items():
                found[digest] = (size, (*found.get(digest, (0, ()))[1], item))
        return found

    @property
    def size_bytes(self) -> int:
        """The bytes that `damaged_there` reads."""
        return sum(size for size, _ in self.blobs.values())

    def needing(self, items: Sequence[Object]) -> tuple[str, ...]:
        """Return the versions and studies that name any of these objects."""
        return tuple(holder.folder.as_posix() for holder in self.holders if not holder.objects.isdisjoint(items))


def readable(found: Census, scene: str | None) -> Readable:
    """Read the versions, studies and records in a census."""
    damage: list[SharedDamage] = []
    holders, records = [], {}
    for top, file in COUNTS_BY.items():
        for entry in found.below(top):
            if entry.name.endswith(f"/{file}"):
                try:
                    holder = found.holder(entry.name)
                except StoreError as error:
                    damage.append(SharedDamage(entry.name, error.problem))
                else:
                    holders += [holder] if holder else []
    for of in sorted({holder.folder.parent for holder in holders if holder.folder.parts[0] != layout.STUDIES}):
        try:
            found.published(of)
        except StoreError as error:
            damage.append(SharedDamage(f"{of.as_posix()}/{layout.PUBLISHED}", error.problem))
    wanted = set(found.objects)
    if scene is not None:
        wanted &= {item for holder in holders if holder.scene == scene for item in holder.objects}
        damage = [one for one in damage if one.name.split("/")[1] == scene]
    for item in sorted(wanted):
        try:
            record = found.record(item)
        except StoreError as error:
            damage.append(SharedDamage(record_names([item])[0], error.problem, (item,)))
        else:
            records |= {item: record} if record else {}
    return Readable(records, holders, damage)


def damaged_there(bucket: Bucket, seen: Readable, on_bytes: OnBytes) -> Iterator[SharedDamage]:
    """Yield what is damaged; the bytes of every file are read, once each."""
    yield from seen.damage
    with ThreadPoolExecutor(_TOGETHER) as pool:
        faults = pool.map(partial(_fault, bucket, on_bytes), seen.blobs)
        for (digest, (_, items)), what in zip(seen.blobs.items(), faults, strict=True):
            if what:
                yield SharedDamage(f"{layout.BLOBS}/{digest}", what, items, seen.needing(items))


def repair_there(store: Store, seen: Readable, one: SharedDamage) -> str:
    """Put whole bytes in the place of damaged ones if this machine has them; else delete them, so that a run makes them again.

    Returns what was done.
    """
    assert store.shared is not None
    bucket, digest = store.shared.bucket, one.name.rpartition("/")[2]
    for item in one.items if one.name.startswith(f"{layout.BLOBS}/") else ():
        for name, entry in seen.records[item].files.items():
            file = store.object_dir(*item) / FILES / name
            if entry.sha256 == digest and file.is_file() and sha256_of(file) == digest:
                bucket.put(one.name, file)
                return "put again: this machine has it"
    bucket.delete(record_names(one.items))  # before the bytes: an object is whole or not there
    bucket.delete([one.name])
    for item in one.items:
        store.let_go(*item)
    objects = (
        f"deleted, with the record of {', '.join(' '.join(item) for item in one.items)}" if one.items else "deleted"
    )
    return f"{objects}: run the scene again to have another"


def _fault(bucket: Bucket, on_bytes: OnBytes, digest: str) -> str:
    """Return what is wrong with the bytes of a file, "" if they are whole."""
    try:
        found = bucket.digest(f"{layout.BLOBS}/{digest}", on_bytes)
    except FileNotFoundError:
        return "is missing"
    return "" if found == digest else "holds other bytes than were written"
