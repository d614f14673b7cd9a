"""What may go from a store that several machines share, and how it goes while they are at work.

Which versions stay is decided as in the folder of one machine (`retention`). What no version and no study names goes in two
steps: whoever looks leaves a mark of it; it goes once it has stood in every mark for as long as is asked, at least an hour.
Times are those of the service, of what it got when: no clock of a machine counts. A machine that begins to use an object
that is marked says so (`Shared.keep`), and it stays. A record goes before the bytes that it names, and is put back if a
machine began to use it that very moment; the bytes go a look later.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from aug3d_core.store import layout
from aug3d_core.store.bucket import Bucket, Entry
from aug3d_core.store.census import COUNTS_BY, Census, census, record_names
from aug3d_core.store.marks import Mark, leave_mark, read_mark
from aug3d_core.store.retention import STUDY, VERSION, WORK, newest_kept
from aug3d_core.store.usage import Holder, Object, objects_of

FILES, LEFT = "files of no object", "left of dead work"
LEAST_S = 3600.0  # that a mark must stand: machines look at the marks every ten minutes
_TOGETHER = 200  # objects that go at once: between the last look at who uses them, and the next


@dataclass(frozen=True)
class Loose:
    """What may go together. names: in the bucket, in the order in which they go."""

    scene: str
    what: str
    names: tuple[str, ...]
    size_bytes: int
    item: Object | None = None
    folder: Path | None = None  # of a version or a study


@dataclass(frozen=True)
class Sweep:
    """What goes now; and what nobody needs either, but goes at a later look if nobody begins to use it: `mark` names both."""

    found: Census
    goes: tuple[Loose, ...]
    waits: tuple[Loose, ...] = ()
    mark: Mark = field(default_factory=Mark)


def look(found: Census, keep: int, hours: float, scene: str | None = None) -> Sweep:
    """Return what nobody needs, where each scene keeps its `keep` newest versions; or, besides, all of a scene's.

    hours: that a mark must have stood. Raises StoreError where a version, a study or a record cannot be read.
    """
    now_s = max((entry.modified_s for entry in found.entries), default=0.0)
    wait_s = max(3600 * hours, LEAST_S)
    settled = {entry.name for entry in found.entries if entry.modified_s <= now_s - wait_s}
    going = _holders_that_go(found, keep, scene, settled)
    named = objects_of(holder for holder in found.holders if holder not in going)
    busy = _busy(found, now_s)
    used = {_item(entry) for entry in found.below(layout.USED) if entry.name not in settled}
    spared = {*named, *used, *busy}
    objects = {
        item: entries
        for item, entries in found.objects.items()
        if item not in spared and all(entry.name in settled for entry in entries)
    }
    held = {entry.sha256 for record in found.records.values() for entry in record.files.values()}
    blobs = [digest for digest, entry in found.blobs.items() if digest not in held and entry.name in settled]
    mark = Mark(frozenset("/".join(item) for item in objects), frozenset(blobs))
    loose = [
        *(_object(found, item, entries) for item, entries in sorted(objects.items())),
        *(Loose("", FILES, (found.blobs[digest].name,), found.blobs[digest].size_bytes) for digest in sorted(blobs)),
    ]
    ripe = _ripe(found, settled)
    now = [each for each in loose if _called(each) in ripe]
    versions = [_holder(found, holder) for holder in going]
    goes = (*versions, *now, *_rest(found, settled, busy))
    return Sweep(found, goes, tuple(each for each in loose if _called(each) not in ripe), mark)


def sweep(bucket: Bucket, home: Path | None, keep: int, hours: float, scene: str | None = None) -> Sweep:
    """Delete what may go now, and mark the rest; returns what was done. Raises StoreError as `look` does."""
    bucket.put(layout.CLOCK, b"")  # what the service got just now tells its time
    found = census(bucket, home)
    seen = look(found, keep, hours, scene)
    leave_mark(bucket, seen.mark)
    objects = [loose for loose in seen.goes if loose.item]
    blobs = [loose for loose in seen.goes if loose.what == FILES]
    others = [loose for loose in seen.goes if loose.item is None and loose.what != FILES]
    for loose in others:
        for name in loose.names:  # in order: first that by which a version counts
            bucket.delete([name])
    gone = [*others, *_drop_objects(bucket, objects), *_drop_blobs(found, blobs)]
    return Sweep(found, tuple(gone), seen.waits, seen.mark)


def _drop_objects(bucket: Bucket, objects: Sequence[Loose]) -> Iterator[Loose]:
    """Delete objects that nobody begins to use, the record first."""
    for start in range(0, len(objects), _TOGETHER):
        some = {loose.item: loose for loose in objects[start : start + _TOGETHER] if loose.item not in _users(bucket)}
        records = {item: bucket.get(record_names([item])[0]) for item in some if item}
        bucket.delete(record_names(records))
        late = _users(bucket)
        for item, content in records.items():
            if item in late and content is not None:
                bucket.create(record_names([item])[0], content)
        gone = [loose for item, loose in some.items() if item not in late]
        bucket.delete([name for loose in gone for name in loose.names])
        yield from gone


def _drop_blobs(found: Census, blobs: Sequence[Loose]) -> Iterator[Loose]:
    """Delete bytes that no record names, those neither that came, or were put again, after the first look."""
    if not blobs:
        return
    bucket = found.bucket
    again = census(bucket, found.home)
    new = [item for item in again.objects if item not in found.objects]
    records = (again.record(item) for item in new)
    named = {entry.sha256 for record in records if record for entry in record.files.values()}
    for start in range(0, len(blobs), _TOGETHER):
        gone = [
            loose
            for loose in blobs[start : start + _TOGETHER]
            if (digest := _last(loose.names[0])) not in named and again.blobs.get(digest) == found.blobs[digest]
        ]
        bucket.delete([loose.names[0] for loose in gone])
        yield from gone


def _users(bucket: Bucket) -> set[Object]:
    return {_item(entry) for entry in bucket.entries(f"{layout.USED}/")}


def _holders_that_go(found: Census, keep: int, scene: str | None, settled: Collection[str]) -> list[Holder]:
    if scene is not None:
        return [holder for holder in found.holders if holder.scene == scene]
    going = []
    for of in sorted({version.folder.parent for version in found.versions}):
        mine = [version for version in found.versions if version.folder.parent == of]
        kept = newest_kept(mine, keep, found.published(of))
        going += [v for v in mine if v.folder not in kept and f"{v.folder.as_posix()}/{layout.METRICS}" in settled]
    return going


def _holder(found: Census, holder: Holder) -> Loose:
    of = holder.folder.parts[0]
    entries = found.below(holder.folder.as_posix())
    names = sorted((entry.name for entry in entries), key=lambda name: (_last(name) != COUNTS_BY[of], name))
    if (
        of != layout.STUDIES and found.published(holder.folder.parent) == holder.folder
    ):  # only where all of a scene goes
        names.append(f"{holder.folder.parent.as_posix()}/{layout.PUBLISHED}")
    size = sum(entry.size_bytes for entry in entries)
    return Loose(holder.scene, STUDY if of == layout.STUDIES else VERSION, tuple(names), size, folder=holder.folder)


def _object(found: Census, item: Object, entries: Sequence[Entry]) -> Loose:
    names = sorted((entry.name for entry in entries), key=lambda name: (_last(name) != layout.RECORD, name))
    return Loose("", item[0], tuple(names), sum(entry.size_bytes for entry in entries), item)


def _rest(found: Census, settled: Collection[str], busy: Collection[Object]) -> Iterator[Loose]:
    """Yield what dead work has left: partial files, leases, half a version, old marks and uses."""
    work: dict[Object, list[Entry]] = {}
    for entry in found.below(layout.WORK):
        work.setdefault(_item(entry, layout.WORK), []).append(entry)
    for item, entries in work.items():
        if item not in busy and (item in found.records or all(entry.name in settled for entry in entries)):
            yield Loose("", WORK, tuple(e.name for e in entries), sum(e.size_bytes for e in entries))
    counted = {holder.folder.as_posix() for holder in found.holders}
    half = [
        entry
        for top in (layout.SCENES, layout.COLLECTIONS)
        for entry in found.below(top)
        if entry.name.count("/") > 2 and "/".join(entry.name.split("/")[:3]) not in counted
    ]
    leases = [entry for entry in found.below(layout.LEASES) if _item(entry, layout.LEASES) not in busy]
    old = [entry for entry in (*half, *leases, *found.below(layout.USED)) if entry.name in settled]
    old += [entry for entry in found.below(layout.MARKS) if entry.name in settled][:-1]
    yield from (Loose("", LEFT, (entry.name,), entry.size_bytes) for entry in old)


def _busy(found: Census, now_s: float) -> set[Object]:
    """Return the objects that somebody makes: a lease is renewed all the time."""
    fresh = (entry for entry in found.below(layout.LEASES) if entry.modified_s > now_s - LEAST_S)
    return {_item(entry, layout.LEASES) for entry in fresh}


def _ripe(found: Census, settled: Collection[str]) -> frozenset[str]:
    """Return what stands in every mark from the last one that is old enough on: objects as stage/key, blobs."""
    marks = found.below(layout.MARKS)
    old = [place for place, mark in enumerate(marks) if mark.name in settled]
    if not old:
        return frozenset()
    told = (read_mark(found.bucket, mark.name) for mark in marks[old[-1] :])
    return frozenset.intersection(*(mark.objects | mark.blobs for mark in told))


def _called(loose: Loose) -> str:
    return "/".join(loose.item) if loose.item else _last(loose.names[0])


def _item(entry: Entry, below: str = layout.USED) -> Object:
    stage, key, *_ = entry.name.removeprefix(f"{below}/").split("/")
    return stage, key


def _last(name: str) -> str:
    return name.rpartition("/")[2]
