"""How people name a version: `scene`, the newest; `scene@published`; `scene@2026-11-21`, as much of its time as says which."""

from __future__ import annotations

from pathlib import Path

from aug3d_core.run.errors import UsageError
from aug3d_core.store.published import published
from aug3d_core.store.scenes import last_version, versions
from aug3d_core.store.store import Store

_PUBLISHED = "published"
_NAMED = 3


def find_version(store: Store, name: str) -> Path:
    """Return the folder of a version; raises UsageError that names those there are."""
    scene, at, which = name.partition("@")
    last_version(store, scene)  # raises if there is none
    found = versions(store, scene)
    if not at:
        return found[-1]
    if which == _PUBLISHED:
        if (folder := published(store, scene)) is None:
            raise UsageError(f"no version of scene {scene!r} is published", f"name one: {_some(scene, found)}")
        return folder
    fitting = [folder for folder in found if which and folder.name.startswith(which)]
    if len(fitting) != 1:
        problem = f"{len(fitting)} versions of scene {scene!r} begin with {which!r}"
        raise UsageError(problem, f"name one: {_some(scene, fitting or found)}")
    return fitting[0]


def _some(scene: str, folders: list[Path]) -> str:
    newest = [f"{scene}@{folder.name}" for folder in reversed(folders)]
    return ", ".join(newest[:_NAMED]) + (f" (of {len(newest)})" if len(newest) > _NAMED else "")
