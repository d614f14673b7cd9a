"""Who needs what of the store: a scene's versions and studies hold the objects that they name."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aug3d_core.run.errors import StoreError
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import step_objects
from aug3d_core.store.seal import unsealed
from aug3d_core.store.store import Store

Object = tuple[str, str]  # stage, key


@dataclass(frozen=True)
class Holder:
    """A version of a scene, or a study of one, and the objects that it names. whole: no stage of it failed."""

    scene: str
    folder: Path
    objects: frozenset[Object]
    whole: bool = True


@dataclass(frozen=True)
class Usage:
    """What a scene takes on the disk. own: would go with it; shared: objects that another scene needs too.

    An object that several versions of the scene need is counted once.
    """

    versions: int
    studies: int
    own_bytes: int
    shared_bytes: int


def _of_version(told: Mapping[str, Any]) -> tuple[frozenset[Object], bool]:
    return frozenset(step_objects(told).values()), "failure" not in told


def _of_study(told: Mapping[str, Any]) -> tuple[frozenset[Object], bool]:
    return frozenset((stage, key) for stage, key in told["objects"]), True


# What a holder names and whether it is whole, by the folder that it is in
READS: Mapping[str, Callable[[Mapping[str, Any]], tuple[frozenset[Object], bool]]] = {
    layout.SCENES: _of_version,
    layout.COLLECTIONS: _of_study,
    layout.STUDIES: _of_study,
}


def versions(store: Store) -> list[Holder]:
    """Return every version of a scene or a collection that counts, oldest first; raises StoreError if one cannot be read."""
    return [
        holder for top in (layout.SCENES, layout.COLLECTIONS) for holder in _holders(store.root / top, layout.METRICS)
    ]


def studies(store: Store) -> list[Holder]:
    """Return every study; raises StoreError if one cannot be read."""
    return _holders(store.root / layout.STUDIES, layout.STUDY_FINDINGS)


def named(records: Iterable[Record]) -> list[Object]:
    """Return the objects of records, each once, as a study's findings name them under `objects`."""
    return sorted({(record.stage, record.key) for record in records})


def objects_of(holders: Iterable[Holder]) -> frozenset[Object]:
    """Return all objects that any of these name."""
    return frozenset().union(*(holder.objects for holder in holders))


def usage(store: Store) -> dict[str, Usage]:
    """Return what each scene with a version or a study takes; raises StoreError if one cannot be read."""
    holders = [*versions(store), *studies(store)]
    sizes = {item: bytes_under(store.object_dir(*item)) for item in objects_of(holders)}
    return usage_of(holders, sizes, bytes_under)


def usage_of(
    holders: Sequence[Holder], sizes: Mapping[Object, int], bytes_of: Callable[[Path], int]
) -> dict[str, Usage]:
    """Return what each scene takes. sizes: bytes of each object. bytes_of: those of a holder's folder."""
    found = {}
    for scene in sorted({holder.scene for holder in holders}):
        objects = objects_of(holder for holder in holders if holder.scene == scene)
        others = objects_of(holder for holder in holders if holder.scene != scene)
        folders = [holder.folder for holder in holders if holder.scene == scene]
        of_studies = sum(folder.parent.parent.name == layout.STUDIES for folder in folders)
        found[scene] = Usage(
            versions=len(folders) - of_studies,
            studies=of_studies,
            own_bytes=sum(map(bytes_of, folders)) + sum(sizes[item] for item in objects - others),
            shared_bytes=sum(sizes[item] for item in objects & others),
        )
    return found


def besides(store: Store) -> dict[str, int]:
    """Return the bytes of what is no scene's, by what it is."""
    parts = {
        "unfinished work": (layout.WORK,),
        "failures": (layout.FAILURES,),
        "benchmarks": (layout.BENCH,),
        "MLflow": (layout.MLFLOW_ARTIFACTS, layout.MLFLOW_DATABASE, layout.MLFLOW_OUTBOX),
        "Prefect": (layout.PREFECT,),
    }
    return {what: sum(bytes_under(store.root / name) for name in names) for what, names in parts.items()}


def bytes_under(path: Path) -> int:
    """Return the bytes of a file, or of all files below a folder; what is linked from elsewhere does not count."""
    total = path.stat().st_size if path.is_file() else 0
    for parent, _, names in os.walk(path):
        for name in names:
            with suppress(FileNotFoundError):  # someone works there meanwhile
                total += (Path(parent) / name).lstat().st_size
    return total


def _holders(folder: Path, file: str) -> list[Holder]:
    read, found = READS[folder.name], []
    for path in sorted(folder.glob(f"*/[!.]*/{file}")):
        try:
            objects, whole = read(unsealed(path.read_bytes()))
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise StoreError(
                f"{path} does not say which objects it needs",
                f"aug3d verify --repair puts it aside; or delete its folder {path.parent}",
            ) from error
        found.append(Holder(path.parent.parent.name, path.parent, objects, whole))
    return found
