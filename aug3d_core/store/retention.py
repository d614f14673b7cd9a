"""What may go from the store, and how it goes.

Each scene and each collection keeps its published version, its newest ones, the newest that did not fail, and those that
MLflow is still to be told of; a study keeps what it made. What none of these names, a killed run or study may yet go on
from: that stays for some hours. Versions go before the objects that they name, and either is out of sight before its files
go: a deletion that is cut short leaves nothing that looks whole.
"""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.store import layout
from aug3d_core.store.published import names, published
from aug3d_core.store.store import Store, discard
from aug3d_core.store.usage import Holder, Object, bytes_under, objects_of, studies, versions

VERSION, STUDY, WORK, FAILURE, REMAINS = "version", "study", "unfinished work", "failure", "half deleted or damaged"


@dataclass(frozen=True)
class Waste:
    """A folder that may go. scene: whose it was, empty if nobody's or several'; what: one of the above, else a stage."""

    scene: str
    what: str
    folder: Path
    size_bytes: int


@dataclass(frozen=True)
class Plan:
    """What goes, in order; and what nobody needs either, but is young yet."""

    goes: tuple[Waste, ...]
    young: tuple[Waste, ...] = ()


def plan(store: Store, keep: int, keep_hours: float) -> Plan:
    """Return what no scene, collection or study needs, where the first two keep their `keep` newest versions.

    Raises StoreError where a version or a study cannot be read: what it needs is not known.
    """
    every, made = versions(store), studies(store)
    kept = _untold(store)
    for of in {version.folder.parent for version in every}:
        mine = [version for version in every if version.folder.parent == of]
        kept |= newest_kept(mine, keep, published(store, of.name, of.parent.name))
    old = [version for version in every if version.folder not in kept]
    goes = _with_objects(store, old, [*(v for v in every if v.folder in kept), *made])
    loose = list(_loose(store, objects_of([*every, *made])))
    oldest_s = time.time() - 3600 * keep_hours
    young = [waste for waste in loose if waste.what != REMAINS and _touched_s(waste.folder) > oldest_s]
    return Plan((*goes, *(waste for waste in loose if waste not in young)), tuple(young))


def plan_for_scene(store: Store, scene: str) -> Plan:
    """Return everything that is a scene's alone, its studies too; raises UsageError if there is nothing of it."""
    holders = [*versions(store), *studies(store)]
    if scene not in {holder.scene for holder in holders}:
        known = ", ".join(sorted({holder.scene for holder in holders})) or "none yet"
        raise UsageError(f"there is nothing of a scene {scene!r} in {store.root}", f"scenes here: {known}")
    goes = [holder for holder in holders if holder.scene == scene]
    return Plan(tuple(_with_objects(store, goes, [holder for holder in holders if holder.scene != scene])))


def drop(store: Store, goes: Iterable[Waste]) -> None:
    """Delete, within `store.alone()`; raises StoreError at the first that cannot be, or that someone makes after all."""
    for waste in goes:
        try:
            _drop(store, waste)
        except OSError as error:
            raise StoreError(
                f"{error.filename or waste.folder} cannot be deleted: {error.strerror}",
                "see whose it is, then run aug3d gc again: it goes on where it was",
            ) from error


def _drop(store: Store, waste: Waste) -> None:
    folder = waste.folder
    if waste.what == VERSION:
        if names(folder.parent / layout.PUBLISHED, folder):
            (folder.parent / layout.PUBLISHED).unlink()
        _drop_folder(folder, layout.METRICS)
    elif waste.what == STUDY:
        _drop_folder(folder, layout.STUDY_FINDINGS)
    elif waste.what in (FAILURE, REMAINS):
        shutil.rmtree(folder) if folder.is_dir() else folder.unlink()
    else:
        stage, key = _object(folder)
        with store.lock(stage, key, timeout_s=0):
            shutil.rmtree(folder) if waste.what == WORK else discard(folder)


def _drop_folder(folder: Path, counts_by: str) -> None:
    """Delete a version or a study, first the file by which it counts; and the scene's folder with the last of them."""
    (folder / counts_by).unlink(missing_ok=True)
    shutil.rmtree(folder)
    with suppress(OSError):
        folder.parent.rmdir()


def newest_kept(mine: Sequence[Holder], keep: int, shown: Path | None) -> set[Path]:
    """Return the folders of the versions of a scene that stay, of all of them, oldest first. shown: the published one."""
    whole = [version for version in mine if version.whole]
    return {version.folder for version in (*mine[-keep:], *whole[-1:])} | ({shown} if shown else set())


def _untold(store: Store) -> set[Path]:
    """Return the versions that MLflow, out of reach so far, is still to be told of."""
    found = set()
    for file in (store.root / layout.MLFLOW_OUTBOX).glob("[!.]*.json"):
        with suppress(FileNotFoundError, ValueError, KeyError, TypeError):
            entry = json.loads(file.read_bytes())
            found.add(store.root / layout.SCENES / entry["scene"] / entry["version"])
    return found


def _with_objects(store: Store, goes: Sequence[Holder], stays: Sequence[Holder]) -> Iterator[Waste]:
    """Yield versions and studies, then the objects that only they name."""
    for holder in goes:
        what = STUDY if holder.folder.is_relative_to(store.root / layout.STUDIES) else VERSION
        yield Waste(holder.scene, what, holder.folder, bytes_under(holder.folder))
    for stage, key in sorted(objects_of(goes) - objects_of(stays)):
        scenes = {holder.scene for holder in goes if (stage, key) in holder.objects}
        folder = store.object_dir(stage, key)
        if folder.exists():
            yield Waste(scenes.pop() if len(scenes) == 1 else "", stage, folder, bytes_under(folder))


def _loose(store: Store, named: Collection[Object]) -> Iterator[Waste]:
    """Yield what no version and no study names, and nobody is making."""
    for top in (layout.SCENES, layout.COLLECTIONS, layout.STUDIES):
        for aside in sorted((store.root / top).glob(f"*/{layout.DAMAGED}*")):
            yield Waste(aside.parent.name, REMAINS, aside, bytes_under(aside))
    for top in (layout.SCENES, layout.COLLECTIONS):
        for version in sorted((store.root / top).glob("*/[!.]*")):
            if version.is_dir() and not (version / layout.METRICS).exists():  # its run was killed before it counted
                yield Waste(version.parent.name, VERSION, version, bytes_under(version))
    for folder in sorted((store.root / layout.OBJECTS).glob("*/*")):
        if folder.name.startswith(layout.GONE):
            yield Waste("", REMAINS, folder, bytes_under(folder))
        elif _object(folder) not in named:
            yield Waste("", folder.parent.name, folder, bytes_under(folder))
    for what, top in ((WORK, layout.WORK), (FAILURE, layout.FAILURES)):
        for folder in sorted((store.root / top).glob("*/*")):
            if what == FAILURE or not store.being_made(*_object(folder)):
                yield Waste("", what, folder, bytes_under(folder))


def _object(folder: Path) -> Object:
    return folder.parent.name, folder.name


def _touched_s(folder: Path) -> float:
    """Return when anything directly in a folder was last changed, seconds since 1970."""
    with suppress(FileNotFoundError):
        return max(path.stat().st_mtime for path in (folder, *folder.iterdir()))
    return time.time()
