"""The files of the registry: `scenes/<scene>.yaml`, beside the folder of the scene's versions."""

from __future__ import annotations

from pathlib import Path

from aug3d_core.run.atomic_file import write_synced
from aug3d_core.run.errors import Aug3dError, InputError, UsageError
from aug3d_core.scene_files.check import checked_entry
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.registry import Registry
from aug3d_core.scene_files.schedule import Schedule
from aug3d_core.scene_files.text import with_schedule, written
from aug3d_core.store import layout
from aug3d_core.store.store import Store

REGISTRY = Registry(layout.SCENES, "scene", "aug3d scenes", checked_entry, written)


def read_scene(store: Store, scene: str) -> SceneEntry:
    """Return what the registry says of a scene.

    Raises UsageError if it says nothing, InputError naming file, line and field if it says something wrong.
    """
    return REGISTRY.read(store, scene)


def read_each(store: Store) -> dict[str, SceneEntry | Aug3dError]:
    """Return every scene of the registry, or what is wrong with it: one bad file does not hide the others."""
    return REGISTRY.read_each(store)


def scene_file(store: Store, scene: str) -> Path:
    """Return the file of a scene; raises UsageError if there is none, InputError if there are two."""
    return REGISTRY.file(store, scene)


def write_scene(store: Store, scene: str, entry: SceneEntry) -> Path:
    """Write the file of a new scene and return it; raises UsageError if there is one, which stays as it is."""
    return REGISTRY.add(store, scene, entry)


def write_schedule(store: Store, scene: str, schedule: Schedule | None) -> SceneEntry:
    """Change a scene's schedule in its file, the rest of which stays as it is; raises UsageError if that cannot be."""
    with REGISTRY.alone(store):
        file = scene_file(store, scene)
        before = REGISTRY.read_file(file)
        content = with_schedule(file.read_bytes().decode(), schedule).encode()
        if not _says(file, content, before.model_copy(update={"schedule": schedule})):
            raise UsageError(f"the schedule in {file} cannot be changed without touching the rest", "change it by hand")
        write_synced(file, content)
        return REGISTRY.read_file(file)


def remove_scene(store: Store, scene: str) -> Path:
    """Remove a scene's file from the registry and return where it was; its versions and objects stay."""
    return REGISTRY.remove(store, scene)


def _says(file: Path, content: bytes, entry: SceneEntry) -> bool:
    try:
        return checked_entry(file, content) == entry
    except InputError:
        return False
