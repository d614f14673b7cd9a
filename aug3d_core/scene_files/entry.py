"""The content of one scene file."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from socket import gethostname
from typing import Any, Self

from pydantic import Field, PrivateAttr, ValidationInfo, field_validator, model_validator

from aug3d_core.factory.config import AUTO, PRESETS, SceneConfig, validated_config, with_settings
from aug3d_core.factory.material import Elsewhere, Material
from aug3d_core.photos.discover import trouble_with, trouble_with_photos
from aug3d_core.run.errors import InputError
from aug3d_core.run.stage import Frozen
from aug3d_core.scene_files.document import Place
from aug3d_core.scene_files.schedule import Schedule

FOLDER = "folder"  # in the context of a validation: where relative paths start


class Publishing(Frozen):
    """When a new version may replace the published one."""

    most_psnr_drop_db: float = Field(
        default=0.5, ge=0, description="Largest loss of PSNR against the published version [dB]."
    )


@dataclass(frozen=True)
class Origin:
    """Where an entry was read: two entries that say the same are equal wherever they come from."""

    file: Path | None = field(default=None, compare=False)
    lines: Mapping[Place, int] = field(default_factory=dict, compare=False)

    def of(self, name: str) -> str:
        """Return `file:line: name` of a field, or its name alone if the entry was not read from a file."""
        return f"{self.file}:{self.line((name,))}: {name}" if self.file else name

    def line(self, place: Place) -> int:
        """Return the line of a field, or of what it would be part of."""
        return self.lines.get(self.known(place), 1)

    def known(self, place: Place) -> Place:
        """Return the part of a place that stands in the file."""
        return next((place[:n] for n in range(len(place), 0, -1) if place[:n] in self.lines), ())


class SceneEntry(Frozen):
    """Where a scene's photographs are, and how and when to run it. Paths are absolute after reading."""

    photos: Path | None = Field(description="Folder of photographs; null is the built-in town.")
    poses: Path | None = Field(default=None, description="Camera poses to use instead of computing them.")
    preset: str = Field(default="tiny", description="Size of everything.")
    settings: dict[str, dict[str, Any]] = Field(
        default={}, description="Settings that differ from the preset's: stage, then field."
    )
    licence: str | None = Field(default=None, description="Terms under which the photographs may be used.")
    description: str = Field(default="", description="A sentence for lists of scenes.")
    tags: tuple[str, ...] = Field(default=(), description="Words to find it by.")
    schedule: Schedule | None = Field(default=None, description="When to run the scene again automatically.")
    publish: Publishing = Field(default=Publishing(), description="When a new version is published.")
    _origin: Origin = PrivateAttr(default=Origin())

    @field_validator("photos", "poses")
    @classmethod
    def _is_absolute(cls, path: Path | None, info: ValidationInfo) -> Path | None:
        if path is None:
            return None
        if path == Path() or "\0" in str(path):
            raise ValueError("is no path")
        with suppress(RuntimeError):  # a user who does not exist: then it is a name like others
            path = path.expanduser()
        return ((info.context or {}).get(FOLDER, Path()) / path).resolve()

    @field_validator("preset")
    @classmethod
    def _preset_is_known(cls, preset: str) -> str:
        if preset not in PRESETS:
            raise ValueError(f"is not a preset: choose one of {', '.join(PRESETS)}")
        return preset

    @field_validator("settings")
    @classmethod
    def _are_of_stages(cls, settings: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        if AUTO in settings:
            raise ValueError(f"{AUTO} is no stage: write preset: {AUTO}, and here only what it shall not decide")
        return settings

    @model_validator(mode="after")
    def _poses_are_of_photographs(self) -> Self:
        if self.poses and not self.photos:
            raise ValueError("poses are of photographs: name the folder of these, too")
        return self

    def read_from(self, origin: Origin) -> SceneEntry:
        """Return the same entry, whose errors name a file and its lines."""
        entry = self.model_copy()
        entry._origin = origin
        return entry

    def config(self) -> SceneConfig:
        """Return the configuration; raises UsageError that names wrong settings."""
        return validated_config(self.config_values())

    def config_values(self) -> dict[str, Any]:
        """Return the preset's values with the settings over them, not checked yet."""
        return with_settings(self.preset, self.settings)

    def material(self, elsewhere: Elsewhere | None = None) -> Material:
        """Return what the scene is made of; raises InputError that names file, line and folder if it is not there.

        elsewhere: what another machine read of it, which is not looked for here.
        """
        if elsewhere:
            return Material(photos=self.photos, poses=self.poses, elsewhere=elsewhere)
        if self.photos and (trouble := trouble_with_photos(self.photos)):
            raise InputError(
                f"{self._origin.of('photos')}: folder {self.photos} {trouble} (on {gethostname()})",
                "connect the disk that it is on, or name the folder where the photographs are now",
            )
        if self.poses and (trouble := trouble_with(self.poses)):
            raise InputError(
                f"{self._origin.of('poses')}: {self.poses} {trouble} (on {gethostname()})",
                "name the file or folder where the poses are now, or null to compute them",
            )
        return Material(photos=self.photos, poses=self.poses)
