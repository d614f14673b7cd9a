"""What `aug3d scenes` tells of one scene of the registry, as JSON holds it."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from aug3d_core.photos.discover import find_photos
from aug3d_core.run.errors import Aug3dError
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.store.published import published
from aug3d_core.store.scenes import version_metrics, versions
from aug3d_core.store.store import Store


def scene_facts(store: Store, scene: str, entry: SceneEntry | Aug3dError) -> dict[str, Any]:
    """Return a scene's entry, whether its photographs are there, its versions oldest first, and which is published.

    `state` is ok; gone if photographs, poses or the published version are not there; or wrong if the file has mistakes.
    """
    facts: dict[str, Any] = {"scene": scene, **_made(store, scene)}
    if isinstance(entry, Aug3dError):
        return facts | {"state": "wrong", "problem": entry.problem}
    facts |= entry.model_dump(mode="json") | {"changes": _changes(entry)}
    schedule = entry.schedule
    upcoming = schedule.next_time(datetime.now(UTC)) if schedule else None
    facts["when"] = schedule.words() if schedule else "when asked only"
    facts["next"] = upcoming.isoformat(timespec="minutes") if upcoming else None
    try:
        folder = entry.material().photos
        facts["photo_count"] = len(find_photos(folder).names) if folder else None
    except Aug3dError as error:
        facts |= {"photo_count": None, "state": "gone", "problem": error.problem}
    return facts


def _made(store: Store, scene: str) -> dict[str, Any]:
    made: dict[str, Any] = {"state": "ok", "problem": None, "published": None, "versions": []}
    try:
        made["versions"] = [_version(folder) for folder in versions(store, scene)]
        current = published(store, scene)
        made["published"] = current.name if current else None
    except Aug3dError as error:  # the published version is gone, or the name of a file is no scene's
        made |= {"state": "gone", "problem": error.problem}
    return made


def _version(folder: Path) -> dict[str, Any]:
    metrics = version_metrics(folder)
    return {
        "version": folder.name,
        "state": metrics["state"],
        "preset": metrics["preset"],
        "psnr_db": metrics.get("nvs", {}).get("test_psnr_mean"),
        "seconds": metrics["seconds"],
    }


def _changes(entry: SceneEntry) -> dict[str, dict[str, Any]]:
    """Return the settings that differ from the preset's: `stage.field` -> value and the preset's value."""
    ours = entry.config().model_dump(mode="json", exclude={"auto"})
    presets = entry.model_copy(update={"settings": {}}).config().model_dump(mode="json", exclude={"auto"})
    return {
        f"{stage}.{field}": {"value": value, "preset": presets[stage][field]}
        for stage, fields in ours.items()
        for field, value in fields.items()
        if value != presets[stage][field]
    }
