"""Why a step has to be made again: what differs from the last time, in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.run.stage import Stage
from aug3d_core.store.damage import DamagedError
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store

_NAMED = 3


def why_made(store: Store, stage: Stage, now: Record, before: Record | None) -> tuple[str, ...]:
    """Return what differs between an object and its like in an earlier version, nothing if they are one."""
    if before is None:
        return ("first time",)
    settings = tuple(_changed_values(before.config, now.config))
    engines = tuple(_changed_values(before.versions, now.versions))
    code = () if settings or engines or now.recipe == before.recipe else ("code of aug3d",)
    inputs = [name for name in {**now.inputs, **before.inputs} if now.inputs.get(name) != before.inputs.get(name)]
    if stage.name == "photos" and inputs:
        return (*code, *settings, *engines, _told_of_photos(store, before, now))
    return (*code, *settings, *engines, *(f"other {name.replace('_', ' ')}" for name in inputs))


def _told_of_photos(store: Store, before: Record, now: Record) -> str:
    try:
        return _photo_changes(*(store.files_dir(record, [PHOTO_TABLE]) for record in (before, now)))
    except DamagedError:  # the earlier table, which nothing else needs
        return "other photographs"


def _photo_changes(before: Path, now: Path) -> str:
    """Return in words which photographs came, went or changed between two outputs of the stage photos."""
    old, new = (dict(_photos(folder)) for folder in (before, now))
    changes = {
        "new": [name for name in new if name not in old],
        "gone": [name for name in old if name not in new],
        "altered": [name for name in new if old.get(name, new[name]) != new[name]],
    }
    told = [f"{len(names)} {what}: {_some(names)}" for what, names in changes.items() if names]
    return "; ".join(told) or "other files, the same photographs"


def _changed_values(before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    for name in {**now, **before}:
        if before.get(name) != now.get(name):
            yield f"{name} {before.get(name, 'none')} -> {now.get(name, 'none')}"


def _photos(folder: Path) -> Iterator[tuple[str, str]]:
    table = pd.read_parquet(folder / PHOTO_TABLE, columns=["name", "sha256"])
    return zip(table["name"], table["sha256"], strict=True)


def _some(names: list[str]) -> str:
    return ", ".join(names[:_NAMED]) + (", ..." if len(names) > _NAMED else "")
