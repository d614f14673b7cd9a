"""What a run would do, without doing it."""

from __future__ import annotations

from collections.abc import Iterator

from aug3d_core.make import Material, gather, key_of, ready
from aug3d_core.scene_config import SceneConfig
from aug3d_core.stage import Stage
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store


def planned(store: Store, material: Material, config: SceneConfig) -> Iterator[tuple[Stage, Record | None]]:
    """Yield every stage of a run with its record if it is in the store, else None.

    A stage whose inputs are still to be made counts as to be made: whether its inputs will change is not known yet.
    """
    records: dict[str, Record] = {}
    for stage in material.stages():
        found = None
        if ready(stage, records, material):
            sources = gather(store, stage, records, material)
            found = store.find(stage.name, key_of(stage, getattr(config, stage.name), sources))
        if found:
            records[stage.name] = found
        yield stage, found
