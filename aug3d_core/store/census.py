"""All that is in a shared store, by one listing: objects, the bytes of their files, versions, and what is left of dead work."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Collection, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from aug3d_core.run.errors import StoreError
from aug3d_core.store import layout
from aug3d_core.store.bucket import Bucket, Entry
from aug3d_core.store.record import Record, record_of
from aug3d_core.store.seal import unsealed
from aug3d_core.store.usage import READS, Holder, Object, Usage, objects_of, usage_of

_TOGETHER = 8  # requests at once
COUNTS_BY = {
    layout.SCENES: layout.METRICS,
    layout.COLLECTIONS: layout.METRICS,
    layout.STUDIES: layout.STUDY_FINDINGS,
}


@dataclass(frozen=True)
class Census:
    """The content of a bucket at one moment. home: files of a machine that need not be downloaded."""

    bucket: Bucket
    home: Path | None
    entries: tuple[Entry, ...]

    @cached_property
    def objects(self) -> Mapping[Object, list[Entry]]:
        """What there is of each object that has a record, or had one."""
        found: dict[Object, list[Entry]] = {}
        for entry in self.below(layout.OBJECTS):
            _, stage, key, *_ = entry.name.split("/")
            found.setdefault((stage, key), []).append(entry)
        return found

    @cached_property
    def blobs(self) -> Mapping[str, Entry]:
        """The bytes of files, by their SHA-256."""
        return {entry.name.rpartition("/")[2]: entry for entry in self.below(layout.BLOBS)}

    @cached_property
    def records(self) -> Mapping[Object, Record]:
        """The records that there are; raises StoreError that names one that cannot be read."""
        items = [item for item, entries in self.objects.items() if any(map(_is_record, entries))]
        with ThreadPoolExecutor(_TOGETHER) as pool:
            found = zip(items, pool.map(self.record, items), strict=True)
            return {item: record for item, record in found if record is not None}

    @cached_property
    def holders(self) -> list[Holder]:
        """Every version and study of every machine, oldest first within a scene; raises StoreError if one cannot be read."""
        names = [e.name for top, file in COUNTS_BY.items() for e in self.below(top) if _last(e.name) == file]
        with ThreadPoolExecutor(_TOGETHER) as pool:
            return [holder for holder in pool.map(self.holder, names) if holder]

    @cached_property
    def versions(self) -> list[Holder]:
        """The versions of scenes and collections among the holders."""
        return [holder for holder in self.holders if holder.folder.parts[0] != layout.STUDIES]

    def published(self, of: Path) -> Path | None:
        """Return the folder of the published version of a scene or a collection, None if there is none. of: its folder."""
        pointer = f"{of.as_posix()}/{layout.PUBLISHED}"
        content = self.bucket.get(pointer)
        try:
            return of / str(unsealed(content)["version"]) if content else None
        except (ValueError, KeyError, TypeError) as error:
            raise StoreError(
                f"{self.bucket.url}/{pointer} does not name a version",
                "delete it: the next good version is then published",
            ) from error

    def usage(self, gone: Collection[Path] = ()) -> dict[str, Usage]:
        """Return what each scene with a version or a study takes; raises StoreError if one cannot be read.

        gone: folders of versions and studies that went meanwhile.
        """
        holders = [holder for holder in self.holders if holder.folder not in gone]
        sizes = {item: self.size_of(item) for item in objects_of(holders)}
        return usage_of(holders, sizes, lambda folder: sum(e.size_bytes for e in self.below(folder.as_posix())))

    def size_of(self, item: Object) -> int:
        """Return the bytes of an object, 0 if there is none."""
        files = self.records[item].files.values() if item in self.records else ()
        blobs = {entry.sha256: entry.size_bytes for entry in files}
        return sum(blobs.values()) + sum(entry.size_bytes for entry in self.objects.get(item, ()))

    def below(self, folder: str) -> list[Entry]:
        """Return what is below a folder."""
        start, end = (bisect_left(self._names, f"{folder}{after}") for after in ("/", "0"))  # "0" follows "/"
        return list(self.entries[start:end])

    def record(self, item: Object) -> Record | None:
        """Return the record of an object, None if it went meanwhile; raises StoreError if it cannot be read."""
        name = f"{layout.OBJECTS}/{'/'.join(item)}/{layout.RECORD}"
        content = self.bucket.get(name)
        try:
            return record_of(content) if content is not None else None
        except ValueError as error:
            raise StoreError(
                f"{self.bucket.url}/{name} is damaged ({error})", "aug3d verify --repair drops it"
            ) from error

    @cached_property
    def _names(self) -> list[str]:
        return [entry.name for entry in self.entries]

    def holder(self, name: str) -> Holder | None:
        """Return the version or the study of a name, None if it went meanwhile; raises StoreError if it cannot be read."""
        here = self.home / name if self.home else None
        content = here.read_bytes() if here and here.exists() else self.bucket.get(name)
        if content is None:
            return None
        try:
            objects, whole = READS[name.partition("/")[0]](unsealed(content))
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise StoreError(
                f"{self.bucket.url}/{name} does not say which objects it needs", "aug3d verify --repair drops it"
            ) from error
        folder = Path(name).parent
        return Holder(folder.parts[1], folder, objects, whole)


def census(bucket: Bucket, home: Path | None) -> Census:
    """List a bucket. home: where versions may lie that then need not be read from it."""
    return Census(bucket, home, tuple(bucket.entries("")))


def record_names(items: Iterable[Object]) -> list[str]:
    """Return the names of the records of objects."""
    return [f"{layout.OBJECTS}/{stage}/{key}/{layout.RECORD}" for stage, key in items]


def _is_record(entry: Entry) -> bool:
    return _last(entry.name) == layout.RECORD


def _last(name: str) -> str:
    return name.rpartition("/")[2]
