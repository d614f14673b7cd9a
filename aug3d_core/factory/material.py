"""What a stage reads: the photographs and poses that the user gives, and what earlier stages made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from aug3d_core.factory.stages import FROM_MODEL, FROM_PHOTOS, FROM_POSES, FROM_TOWN
from aug3d_core.photos.digest_apart import digest_apart
from aug3d_core.photos.discover import digest_of
from aug3d_core.poses.recognise import pose_digest, recognise
from aug3d_core.run.stage import Frozen, Stage
from aug3d_core.store.record import Record, files_digest
from aug3d_core.store.store import Store
from aug3d_core.town.files import TOWN_PHOTOS


class Source(Frozen):
    """An input of a stage: a folder of files, the digest of its content, and the code that the settings behind it named.

    made: the object that it is, None for what the user gave. reads: the only files of it that the stage reads, empty for all.
    """

    path: Path
    digest: str
    modules: tuple[str, ...] = ()
    made: Record | None = None
    reads: tuple[str, ...] = ()


class Elsewhere(Frozen):
    """What another machine read of photographs and poses that only it has.

    photos, poses: digests. photo_count: files that may be photographs. has_points: whether the poses have points.
    """

    photos: str
    photo_count: int
    poses: str | None = None
    has_points: bool = False


class Material(Frozen):
    """What the user gives: a folder of photographs, None for the built-in town; and their poses, None to find them.

    elsewhere: what is known of them where both lie on another machine, None if they are read here.
    """

    photos: Path | None = None
    poses: Path | None = None
    elsewhere: Elsewhere | None = None

    def stages(self) -> tuple[Stage, ...]:
        """Return the stages that make a scene of it; raises InputError if the poses are of no known kind."""
        if self.photos is None:
            return FROM_TOWN
        if self.poses is None:
            return FROM_PHOTOS
        has_points = self.elsewhere.has_points if self.elsewhere else recognise(self.poses).has_points
        return FROM_MODEL if has_points else FROM_POSES


def source_of(store: Store, record: Record, reads: Sequence[str] = ()) -> Source:
    """Return a finished object as an input of a stage. reads: the only files that the stage reads of it, empty for all."""
    digest = files_digest({name: record.files[name] for name in reads}) if reads else record.digest
    return Source(path=store.place(record), digest=digest, modules=record.modules, made=record, reads=tuple(reads))


def gather(store: Store, stage: Stage, records: Mapping[str, Record], material: Material) -> dict[str, Source]:
    """Return the inputs of a stage from the records so far and from what the user gave."""
    return {name: _source(store, stage, name, records, material) for name in stage.inputs}


def ready(stage: Stage, records: Mapping[str, Record], material: Material) -> bool:
    """Say whether all inputs of a stage are there."""
    there = {*records, "given", *(["folder"] if material.photos or "town" in records else [])}
    return there.issuperset(stage.inputs)


def town_photos(store: Store, town: Record) -> Source:
    """Return the photographs of the built-in town as an input; none of them is read for that."""
    reads = tuple(name for name in town.files if name.startswith(f"{TOWN_PHOTOS}/"))
    digest = digest_of({name.removeprefix(f"{TOWN_PHOTOS}/"): town.files[name].sha256 for name in reads})
    return Source(path=store.place(town) / TOWN_PHOTOS, digest=digest, made=town, reads=reads)


def given_photos(folder: Path, elsewhere: Elsewhere | None = None) -> Source:
    """Return the photographs that the user gives as an input."""
    return Source(path=folder, digest=elsewhere.photos if elsewhere else digest_apart(folder))


def given_poses(path: Path, elsewhere: Elsewhere | None = None) -> Source:
    """Return the poses that the user gives as an input."""
    return Source(path=path, digest=elsewhere.poses if elsewhere and elsewhere.poses else pose_digest(path))


def _source(store: Store, stage: Stage, name: str, records: Mapping[str, Record], material: Material) -> Source:
    if name == "folder":
        if material.photos is None:
            return town_photos(store, records["town"])
        return given_photos(material.photos, material.elsewhere)
    if name == "given" and material.poses:
        return given_poses(material.poses, material.elsewhere)
    return source_of(store, records[name], stage.reads.get(name, ()))
