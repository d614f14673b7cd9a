"""What a run would do, without doing it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from aug3d_core.make import gather, key_of
from aug3d_core.scene_config import SceneConfig
from aug3d_core.stage import Stage
from aug3d_core.stages import FROM_PHOTOS, FROM_TOWN
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store


def planned(store: Store, photos: Path | None, config: SceneConfig) -> Iterator[tuple[Stage, Record | None]]:
    """Yield every stage of a run with its record if it is in the store, else None.

    A stage whose inputs are still to be made counts as to be made: whether its inputs will change is not known yet.
    """
    records: dict[str, Record] = {}
    for stage in FROM_PHOTOS if photos else FROM_TOWN:
        found = None
        if all((name == "folder" and (photos or "town" in records)) or name in records for name in stage.inputs):
            sources = gather(store, stage, records, photos)
            found = store.find(stage.name, key_of(stage, getattr(config, stage.name), sources))
        if found:
            records[stage.name] = found
        yield stage, found
