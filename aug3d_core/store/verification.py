"""Read everything in a store that has a digest, and name what is not what was written."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from aug3d_core.run.errors import StoreError
from aug3d_core.run.files import JOB
from aug3d_core.store import layout
from aug3d_core.store.damage import Fault, listed
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import metrics_fault, report_fault
from aug3d_core.store.seal import unsealed
from aug3d_core.store.store import Store
from aug3d_core.store.usage import Object, studies, versions

OnBytes = Callable[[int], None]


@dataclass(frozen=True)
class Damage:
    """What is damaged. item: the object, None of a version, a study or a pointer to one; needed_by: folders that name it."""

    path: Path
    what: str
    item: Object | None = None
    needed_by: tuple[str, ...] = ()


def items_of(store: Store, scene: str | None) -> list[Object]:
    """Return the objects of a store, or those that a scene's or a collection's versions and studies name."""
    if scene is None:
        return sorted((path.parent.name, path.name) for path in (store.root / layout.OBJECTS).glob("*/[!.]*"))
    return sorted({item for holder in _holders(store) if holder[0] == scene for item in holder[1]})


def size_of(store: Store, items: list[Object]) -> int:
    """Return the bytes that `damaged` will read of these objects."""
    return sum(path.stat().st_size for item in items for path in store.object_dir(*item).rglob("*") if path.is_file())


def damaged(store: Store, scene: str | None, items: list[Object], on_bytes: OnBytes) -> Iterator[Damage]:
    """Yield what is damaged among these objects, and in the versions of a scene, or of all."""
    yield from _of_versions(store, scene)
    needed: dict[Object, list[str]] = {}
    for _, objects, folder in _holders(store):
        for item in objects:
            needed.setdefault(item, []).append(folder.relative_to(store.root).as_posix())
    for item in items:
        if found := _of_object(store, item, on_bytes):
            yield Damage(store.object_dir(*item), listed(found), item, tuple(needed.get(item, ())))


def _of_object(store: Store, item: Object, on_bytes: OnBytes) -> list[Fault]:
    record = store.record(*item)
    if not isinstance(record, Record):
        return [record]
    found = store.faults(record, on_bytes=on_bytes)
    with suppress(FileNotFoundError):
        try:
            unsealed((store.object_dir(*item) / JOB).read_bytes())
        except ValueError as error:
            found.append(Fault(JOB, f"is damaged ({error})"))
    return found


def _of_versions(store: Store, scene: str | None) -> Iterator[Damage]:
    for top, pattern in ((layout.SCENES, layout.METRICS), (layout.COLLECTIONS, layout.METRICS)):
        for file in sorted((store.root / top).glob(f"{scene or '*'}/[!.]*/{pattern}")):
            if what := metrics_fault(file.parent) or report_fault(store, file.parent):
                yield Damage(file.parent, what)
        for pointer in sorted((store.root / top).glob(f"{scene or '*'}/{layout.PUBLISHED}")):
            try:
                unsealed(pointer.read_bytes())["version"]
            except (ValueError, KeyError, TypeError) as error:
                yield Damage(pointer, f"does not name a version ({error})")
    for file in sorted((store.root / layout.STUDIES).glob(f"{scene or '*'}/[!.]*/{layout.STUDY_FINDINGS}")):
        try:
            unsealed(file.read_bytes())
        except ValueError as error:
            yield Damage(file.parent, f"{file.name} is damaged ({error})")


def _holders(store: Store) -> list[tuple[str, frozenset[Object], Path]]:
    """Return whose versions and studies name which objects, as far as they can be read."""
    found = []
    for read in (versions, studies):
        with suppress(StoreError):  # that one is damaged is told anyway
            found += [(holder.scene, holder.objects, holder.folder) for holder in read(store)]
    return found
