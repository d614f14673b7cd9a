"""The files of the registry: `scenes/<scene>.yaml`, beside the folder of the scene's versions."""

from __future__ import annotations

import difflib
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from aug3d_core.run.atomic_file import write_synced
from aug3d_core.run.errors import Aug3dError, InputError, UsageError
from aug3d_core.scene_files.check import checked_entry
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.schedule import Schedule
from aug3d_core.scene_files.text import with_schedule, written
from aug3d_core.store import layout
from aug3d_core.store.scene_name import check_scene_name
from aug3d_core.store.store import Store

_PATIENCE_S = 10.0


def read_scene(store: Store, scene: str) -> SceneEntry:
    """Return what the registry says of a scene.

    Raises UsageError if it says nothing, InputError naming file, line and field if it says something wrong.
    """
    return _read(scene_file(store, scene))


def read_each(store: Store) -> dict[str, SceneEntry | Aug3dError]:
    """Return every scene of the registry, or what is wrong with it: one bad file does not hide the others."""
    found: dict[str, SceneEntry | Aug3dError] = {}
    for files in _by_name(store).values():
        try:
            found[files[0].stem] = _read(_only(files))
        except Aug3dError as error:
            found[files[0].stem] = error
    return found


def scene_file(store: Store, scene: str) -> Path:
    """Return the file of a scene; raises UsageError if there is none, InputError if there are two."""
    by_name = _by_name(store)
    files = by_name.get(check_scene_name(scene).casefold(), [])
    if files and scene in [file.stem for file in files]:
        return _only(files)
    known = [files[0].stem for files in by_name.values()]
    near = difflib.get_close_matches(scene, known, n=1)
    raise UsageError(
        f"there is no scene {scene!r} in the registry {store.root / layout.SCENES}",
        f"did you mean {near[0]}?" if near else f"known: {', '.join(known) or 'none yet'}; see aug3d scenes add",
    )


def write_scene(store: Store, scene: str, entry: SceneEntry) -> Path:
    """Write the file of a new scene and return it; raises UsageError if there is one, which stays as it is."""
    file = store.root / layout.SCENES / f"{check_scene_name(scene)}{layout.SCENE_FILES[0]}"
    with _alone(store):
        if files := _by_name(store).get(scene.casefold()):
            raise UsageError(
                f"there is a scene {files[0].stem!r} already: {files[0]}",
                "edit that file, remove the scene with aug3d scenes remove, or choose another name",
            )
        write_synced(file, written(scene, entry).encode())
    return file


def write_schedule(store: Store, scene: str, schedule: Schedule | None) -> SceneEntry:
    """Change a scene's schedule in its file, the rest of which stays as it is; raises UsageError if that cannot be."""
    with _alone(store):
        file = scene_file(store, scene)
        before = _read(file)
        content = with_schedule(file.read_bytes().decode(), schedule).encode()
        if not _says(file, content, before.model_copy(update={"schedule": schedule})):
            raise UsageError(f"the schedule in {file} cannot be changed without touching the rest", "change it by hand")
        write_synced(file, content)
        return _read(file)


def remove_scene(store: Store, scene: str) -> Path:
    """Remove a scene's file from the registry and return where it was; its versions and objects stay."""
    with _alone(store):
        file = scene_file(store, scene)
        file.unlink()
    return file


def _read(file: Path) -> SceneEntry:
    try:
        check_scene_name(file.stem)
        return checked_entry(file, file.read_bytes())
    except UsageError as error:
        raise InputError(f"{file}: {error.problem}", f"give the file another name: {error.remedy}") from error
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror}", "make it a file that you can read") from error


def _says(file: Path, content: bytes, entry: SceneEntry) -> bool:
    try:
        return checked_entry(file, content) == entry
    except InputError:
        return False


def _by_name(store: Store) -> dict[str, list[Path]]:
    """Return the files of each name; upper and lower case are one name, as they are on many disks."""
    by_name: dict[str, list[Path]] = defaultdict(list)
    for file in sorted((store.root / layout.SCENES).iterdir()):
        if file.suffix in layout.SCENE_FILES and not file.name.startswith("."):
            by_name[file.stem.casefold()].append(file)
    return by_name


def _only(files: list[Path]) -> Path:
    if len(files) > 1:
        raise InputError(
            f"{len(files)} files name one scene: {' and '.join(map(str, files))}",
            "keep one of them, or give one another name; upper and lower case are one name",
        )
    return files[0]


@contextmanager
def _alone(store: Store) -> Iterator[None]:
    """Let one process at a time change the registry."""
    with store.lock(layout.SCENES, "registry", _PATIENCE_S):
        yield
