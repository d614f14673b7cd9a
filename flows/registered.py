"""A run of a registered scene: its file says what the command line does not, and where a run differs from it that is told."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.markup import escape

from aug3d_core.factory.config import SceneConfig, overridden
from aug3d_core.factory.material import Material
from aug3d_core.run.errors import Aug3dError, UsageError
from aug3d_core.run.nested import flat
from aug3d_core.scene_files import SceneEntry, read_scene, scene_file
from aug3d_core.store.store import Store
from flows.reading import read_store

_MOST_TOLD = 5


def as_registered(
    home: Path, scene: str, poses: Path | None, preset: str | None, overrides: list[str]
) -> tuple[Material, str, SceneConfig]:
    """Return what a scene is made of, its preset and its settings: what is said here, else what its file says."""
    try:
        entry = read_scene(read_store(home), scene)
    except UsageError as error:
        raise UsageError(f"--photos is missing, and {error.problem}", f"give --photos DIR; {error.remedy}") from error
    if poses and entry.photos is None:
        raise UsageError(f"--poses {poses} is of photographs, and {scene} is the built-in town", "give --photos, too")
    entry = entry.model_copy(update={"preset": preset or entry.preset, **({"poses": None} if poses else {})})
    material = entry.material().model_copy(update={"poses": poses.resolve()} if poses else {})
    return material, entry.preset, overridden(entry.config(), overrides, entry.preset)


def tell_of_file(
    console: Console, store: Store, scene: str, material: Material, preset: str, config: SceneConfig
) -> None:
    """Say whether a run follows the file of its scene, and what that says otherwise; nothing for a scene that has none."""
    try:
        file, entry = scene_file(store, scene), read_scene(store, scene)
    except UsageError:
        return
    except Aug3dError as error:
        _note(console, f"the scene is registered, and its file is wrong: {error.problem}")
        return
    others = [*_other_material(entry, material), *_other_settings(entry, preset, config)]
    if others:
        more = f" and {len(others) - _MOST_TOLD} more" if len(others) > _MOST_TOLD else ""
        told = ", ".join(others[:_MOST_TOLD])
        _note(console, f"{file} says otherwise: {told}{more}; aug3d run {scene} alone follows it")
    else:
        console.print(f"as {file} says", style="dim", highlight=False, soft_wrap=True, markup=False)


def _note(console: Console, told: str) -> None:
    console.print(f"[yellow]note[/] {escape(told)}", highlight=False, soft_wrap=True)


def _other_material(entry: SceneEntry, material: Material) -> list[str]:
    named = {"photos": (entry.photos, material.photos), "poses": (entry.poses, material.poses)}
    return [f"{name} {theirs}" for name, (theirs, ours) in named.items() if theirs != ours]


def _other_settings(entry: SceneEntry, preset: str, config: SceneConfig) -> list[str]:
    """Return what else the file sets: of another preset only that, and the settings that it names itself."""
    ours, theirs = (flat(one.model_dump(mode="json", exclude={"auto"})) for one in (config, entry.config()))
    changed = [path for path in theirs if theirs[path] != ours.get(path)]
    if preset == entry.preset:
        return [f"{path} {theirs[path]}" for path in changed]
    named = flat(entry.settings)
    return [f"preset {entry.preset}", *(f"{path} {theirs[path]}" for path in changed if path in named)]
