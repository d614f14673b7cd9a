"""The scene of a study: the built-in town, one of the registry, or one with a finished run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aug3d_core.factory.config import AUTO, SceneConfig, scene_config
from aug3d_core.run.errors import UsageError
from aug3d_core.run.files import JOB
from aug3d_core.run.nested import flat
from aug3d_core.run.stage import StageConfig
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.files import read_each, read_scene
from aug3d_core.store.record import read_job
from aug3d_core.store.scenes import newest_whole, object_of, records_of, scenes, step_objects
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured

TOWN = "demo"
_SIZED = "tiny"
_NOT_DECIDED = ("town", "dataset")  # the world, and the size of what is predicted


@dataclass(frozen=True)
class StudiedScene:
    """A scene: its photographs, None for the built-in town; its preset, and settings that differ from it."""

    name: str
    photos: Path | None
    own: Measured

    @property
    def town(self) -> bool:
        """Whether the truth is known."""
        return self.photos is None

    def config(self, more: Iterable[str] = ()) -> SceneConfig:
        """Return the configuration with more settings."""
        return self.own.config(more)

    def decided(self) -> Measured:
        """Return the scene as the rules of `auto` decide it, except for what is set by hand and for the size of predictions."""
        own, usual = self.config(), scene_config(AUTO)
        given = {stage: _differing(getattr(own, stage), getattr(usual, stage)) for stage in _NOT_DECIDED}
        return Measured(AUTO, (*_written(given), *self.own.overrides))

    def by_default(self, settings: Iterable[str]) -> StudiedScene:
        """Return the scene with defaults for settings that it does not set itself."""
        return self._having((*settings, *self.own.overrides))

    def with_settings(self, settings: Iterable[str]) -> StudiedScene:
        """Return the scene with more settings of its own."""
        return self._having((*self.own.overrides, *settings))

    def _having(self, settings: Iterable[str]) -> StudiedScene:
        """Return the scene with these settings; of each field the last one counts."""
        last = {one.partition("=")[0]: one for one in settings}
        return StudiedScene(self.name, self.photos, Measured(self.own.preset, tuple(last.values())))


def open_studied(store: Store, name: str, preset: str | None) -> StudiedScene:
    """Return a scene by its name, with another preset if one is given; raises UsageError if there is none."""
    if name in read_each(store):
        return _registered(name, read_scene(store, name), preset)
    if name == TOWN and name not in scenes(store):
        return StudiedScene(name, None, Measured(_sized(preset or _SIZED)))
    return _finished(store, name, preset)


def _sized(preset: str) -> str:
    """Return the preset that arms are compared with. What `auto` decides is an arm."""
    return _SIZED if preset == AUTO else preset


def _registered(name: str, entry: SceneEntry, preset: str | None) -> StudiedScene:
    material = entry.material()
    if material.poses:
        raise UsageError(
            f"scene {name!r} takes its poses from {material.poses}: the cost and gain of poses cannot be measured on it",
            "study a scene whose poses are computed",
        )
    return StudiedScene(
        name, material.photos, Measured(_sized(preset or entry.preset), tuple(_written(entry.settings)))
    )


def _finished(store: Store, name: str, preset: str | None) -> StudiedScene:
    """Return a scene with the settings of the last run that judged it."""
    version = newest_whole(store, name)
    records = records_of(store, version)
    if "poses" in records:
        raise UsageError(
            f"scene {name!r} was made from poses that were given: the cost and gain of poses cannot be measured on it",
            "study a scene whose poses are computed",
        )
    base = _sized(preset or version["preset"])
    usual = scene_config(base).model_dump(mode="json")
    as_it_was = (
        base == version["preset"]
    )  # with another preset, or with sizes that `auto` decided, only the town is kept
    own = {
        stage: {
            field: value
            for field, value in flat(record.config).items()
            if flat(usual[stage]).get(field, value) != value
        }
        for stage, record in records.items()
        if stage in usual and (as_it_was or stage == "town")
    }
    return StudiedScene(name, _photos(store, version), Measured(base, tuple(_written(own))))


def _photos(store: Store, version: Mapping[str, Any]) -> Path | None:
    """Return the folder that the photographs came from, None if the town rendered them."""
    if "town" in step_objects(version):
        return None
    made = store.place(object_of(store, version, "photos")).parent
    folder = Path(read_job(made / JOB)["inputs"]["folder"])
    if not folder.is_dir():
        raise UsageError(
            f"the photographs of scene {version['scene']!r} are no longer in {folder}",
            "restore them, or run the scene again with --photos DIR",
        )
    return folder


def _differing(own: StageConfig, usual: StageConfig) -> dict[str, Any]:
    theirs = flat(usual.model_dump(mode="json"))
    return {name: value for name, value in flat(own.model_dump(mode="json")).items() if theirs.get(name) != value}


def _written(settings: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yield settings as `--set` takes them, the choice of a head first: it brings settings of its own."""
    values = flat(settings)
    yield from (f"{path}={values[path]}" for path in sorted(values, key=lambda path: not path.endswith(".head.name")))
