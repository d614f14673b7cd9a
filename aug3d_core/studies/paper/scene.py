"""The finished scene that a study starts from. Its poses, mesh and split are used as they are."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

from aug3d_core.factory.config import AUTO, SceneConfig, overridden, scene_config, validated_config
from aug3d_core.factory.plan import Step, fold_count, seen_from
from aug3d_core.factory.stages import FROM_PHOTOS, GROUPING, SURFACE
from aug3d_core.run.errors import UsageError
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import newest_that, records_of
from aug3d_core.store.store import Store

GIVEN = ("sfm", "similarity", "depth", "surface")  # what cells read of the scene
_OWN = ("grouping", "sampling", "rendering", "dataset", "training", "evaluation")  # stages that cells make anew


@dataclass(frozen=True)
class FinishedScene:
    """A scene of the store, by step, and the settings from which every arm differs."""

    name: str
    preset: str
    records: Mapping[str, Record]
    settings: SceneConfig

    @property
    def folds(self) -> int:
        """The number of folds that the scene is made in."""
        return fold_count(self.records)

    def given(self, fold: int) -> dict[str, Record]:
        """Return the records that the cells of a fold read, by stage."""
        seen = seen_from(Step(SURFACE, fold), FROM_PHOTOS, self.records)
        return {name: seen[name] for name in GIVEN}

    def split(self, store: Store, fold: int) -> pd.DataFrame:
        """Return the scene's own split: a row per view with its role."""
        return read_split(store, seen_from(Step(GROUPING, fold), FROM_PHOTOS, self.records)[GROUPING.name])

    def config(self, changes: Iterable[str]) -> SceneConfig:
        """Return the settings with changes of the form `stage.field=value`."""
        return overridden(self.settings, changes)


def open_finished(store: Store, name: str, preset: str | None) -> FinishedScene:
    """Return a scene as the last run that made its meshes had it, or with a preset's settings from sampling on.

    Raises UsageError. The split is always the scene's own: the mesh was made without its test photographs.
    """
    version = newest_that(store, name, lambda metrics: not _lost(records_of(store, metrics)))
    found = records_of(store, version)
    if lost := _lost(found):
        raise UsageError(
            f"scene {name!r} has no {lost[0]}: no run came so far, or the object is gone from the store",
            f"run the scene again, and see aug3d show {name}",
        )
    if preset == AUTO:
        raise UsageError(
            "a study uses fixed settings, so --preset auto has nothing to decide",
            "leave out --preset to use what the scene's last run decided",
        )
    values: dict[str, Any] = scene_config(preset or version["preset"]).model_dump() | {"auto": ()}
    for stage in ("grouping",) if preset else _OWN:
        if stage in found:
            values[stage] |= {k: v for k, v in found[stage].config.items() if k in values[stage]}
    return FinishedScene(name, preset or version["preset"], found, validated_config(values))


def _lost(found: Mapping[str, Record]) -> list[str]:
    """Return which stages cells would miss in some fold of what a version is made of."""
    seen = [seen_from(Step(SURFACE, fold), FROM_PHOTOS, found) for fold in range(fold_count(found))]
    return [name for fold in seen for name in (*GIVEN, GROUPING.name) if name not in fold]


def read_split(store: Store, grouping: Record) -> pd.DataFrame:
    """Return photo_id and role of every view."""
    return pd.read_parquet(store.file(grouping, SPLIT_TABLE)).loc[:, ["photo_id", "role"]]
