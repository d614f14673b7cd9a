"""The registry in a shared store: whoever registers scenes puts it there, and workers of other machines bring it.

The folder of files stays the only place that people edit. A path in it is the same on every machine; photographs that are
not there, and poses, are named by the machine that has them.
"""

from __future__ import annotations

import socket
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from aug3d_core.factory.material import Elsewhere
from aug3d_core.run.atomic_file import write_synced
from aug3d_core.run.errors import Aug3dError, StoreError, UsageError
from aug3d_core.run.stage import Frozen
from aug3d_core.scene_files.registry import Registry
from aug3d_core.store import layout
from aug3d_core.store.scene_name import check_scene_name
from aug3d_core.store.store import Store

if TYPE_CHECKING:  # with obstore, which a store of one machine does without
    from aug3d_core.store.bucket import Bucket

_NAME = "registry.json"
_BROUGHT = "# Brought from "  # begins a file that is a copy
Registries = Sequence[Registry[Any]]


class SharedFiles(Frozen):
    """All files of registries, by folder and name, as a machine tells them to others: paths in them absolute."""

    host: str
    files: dict[str, str]


def to_share(store: Store, registries: Registries) -> SharedFiles:
    """Return this home's registries as others are told them."""
    files = {
        f"{registry.folder}/{file.name}": _content(registry, file)
        for registry in registries
        for file in registry.files(store)
        if _is_registry_file(file.name)
    }
    return SharedFiles(host=socket.gethostname(), files=files)


def share(store: Store, bucket: Bucket, registries: Registries) -> None:
    """Put all files of these registries where other machines find them, at once."""
    bucket.put(_NAME, to_share(store, registries).model_dump_json().encode())


def check_has_none_of_its_own(store: Store, registries: Registries) -> None:
    """Raise UsageError if a home has scene files that were not brought: a copy of others' would take their place."""
    for registry in registries:
        for file in registry.files(store):
            if not was_brought(file):
                raise UsageError(
                    f"{file} was written here, but a worker has the scene files of the machine that aug3d up runs on",
                    "choose another folder with --home, or move the file to that machine",
                )


def bring(store: Store, bucket: Bucket, registries: Registries) -> None:
    """Make this home's registries those of the machine that shares them; raises StoreError if none does."""
    take(store, _told(bucket), registries)


def take(store: Store, told: SharedFiles, registries: Registries) -> None:
    """Make this home's registries those of another machine; raises UsageError if it has files of its own."""
    check_has_none_of_its_own(store, registries)
    host = told.host.partition("\n")[0]
    for registry in registries:
        wanted = {
            name.rpartition("/")[2]: f"{_BROUGHT}{host}, where it is edited: a change here is lost.\n{text}"
            for name, text in told.files.items()
            if name.rpartition("/")[0] == registry.folder and _is_registry_file(name)
        }
        with registry.alone(store):
            _write(store.root / registry.folder, registry.files(store), wanted)


def was_brought(file: Path) -> bool:
    """Say whether a file is a copy of another machine's."""
    return file.read_bytes().startswith(_BROUGHT.encode())


def tell_photographs(bucket: Bucket, scene: str, read: Elsewhere) -> None:
    """Tell other machines of a scene's photographs and poses as they are now."""
    bucket.put(f"{layout.PHOTOGRAPHS}/{check_scene_name(scene)}", read.model_dump_json().encode())


def told_photographs(bucket: Bucket, scene: str) -> Elsewhere | None:
    """Return what was told last of a scene's photographs and poses; None if nothing was. Raises StoreError if it is damaged."""
    name = f"{layout.PHOTOGRAPHS}/{check_scene_name(scene)}"
    content = bucket.get(name)
    try:
        return Elsewhere.model_validate_json(content) if content else None
    except ValidationError as error:
        raise StoreError(
            f"{bucket.url}/{name} is damaged", "delete it; the next run of the scene puts it again"
        ) from error


def _write(folder: Path, there: Sequence[Path], wanted: Mapping[str, str]) -> None:
    folder.mkdir(exist_ok=True)
    for name, text in wanted.items():
        if not (folder / name).exists() or (folder / name).read_text() != text:
            write_synced(folder / name, text.encode())
    for file in there:
        if file.name not in wanted:
            file.unlink()


def _content(registry: Registry[Any], file: Path) -> str:
    """Return an entry as it is written; of a file that is wrong what stands in it, so that it is wrong everywhere."""
    try:
        return registry.written(file.stem, registry.read_file(file))
    except Aug3dError:
        return file.read_bytes().decode(errors="replace") if file.is_file() else ""


def _told(bucket: Bucket) -> SharedFiles:
    content = bucket.get(_NAME)
    if content is None:
        raise StoreError(
            f"there is no registry of scenes in {bucket.url}",
            "start aug3d up, on the machine that has the scene files, with the same AUG3D_STORE",
        )
    try:
        return SharedFiles.model_validate_json(content)
    except ValidationError as error:
        raise StoreError(f"{bucket.url}/{_NAME} is damaged", "delete it; aug3d up puts it again") from error


def _is_registry_file(name: str) -> bool:
    file = Path(name.rpartition("/")[2])
    try:
        return file.suffix in layout.SCENE_FILES and bool(check_scene_name(file.stem))
    except UsageError:
        return False
