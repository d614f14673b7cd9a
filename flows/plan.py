"""What a run would do, without doing it."""

from __future__ import annotations

from collections.abc import Iterator

from aug3d_core.folds import Step, seen_from, steps
from aug3d_core.make import Material, gather, key_of, ready
from aug3d_core.needs.settle import settle
from aug3d_core.scene_config import SceneConfig
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store


def planned(store: Store, material: Material, config: SceneConfig) -> Iterator[tuple[Step, Record | None]]:
    """Yield every step of a run with its record if it is in the store, else None.

    A step whose inputs are still to be made counts as to be made: whether its inputs will change is not known yet. Nor are
    folds known before the split is made: there is one until then.
    """
    records: dict[str, Record] = {}
    stages = material.stages()
    for step in steps(stages, records):
        found, seen = None, seen_from(step, stages, records)
        if ready(step.stage, seen, material):
            sources = gather(store, step.stage, seen, material)
            chosen = step.in_fold(settle(step.stage, config, seen, store, material).config)
            found = store.find(step.stage.name, key_of(step.stage, chosen, sources))
        if found:
            records[step.name] = found
        yield step, found
