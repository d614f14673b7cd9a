"""Whether a run fits on the disk: told before anything is computed, not after hours.

What a step will write follows from what it wrote for the scene's last version, scaled by the rules below from the settings
and photographs of then to those of now. Without a last version the rules count as they are: measured on the built-in town
(60 photographs of 640 px) and two real flights (120 and 18 of 1024 px), where they err to the large side. As much
again as the largest step leaves is asked for: it took up to 1.13 times that while it worked, and COLMAP's patch match, where
there is a GPU, leaves every map twice.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from aug3d_core.errors import InputError, StoreError
from aug3d_core.folds import Step, fold_count
from aug3d_core.make import Material
from aug3d_core.photos.discover import find_photos
from aug3d_core.scene_config import SceneConfig
from aug3d_core.stages import GROUPING
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from aug3d_core.testbed.config import TownConfig

_MIB = 2**20
_SPARE_BYTES = 64 * _MIB  # the report, MLflow's copy of it, databases, logs
_LEAST_BYTES = 3 * _MIB  # pictures and tables that any stage writes
_LIKELY_K = 10
_FEW_TESTS, _LEAST_FOLD = 8, 5  # photographs; a split that tests fewer is made in folds of at least so many
_NAMED = 3

Plan = Iterable[tuple[Step, Record | None]]  # every step of a run, and its record if the store has it


@dataclass(frozen=True)
class Extent:
    """What the bytes hang on: the number of photographs, and the settings by stage and field."""

    photos: int
    settings: Mapping[str, Mapping[str, Any]]

    def of(self, stage: str, field: str) -> Any:
        """Return a setting."""
        return self.settings[stage][field]

    @property
    def photo_px(self) -> int:
        """The longer side of a photograph as it is worked on, px; real ones are taken to be large."""
        most = self.of("photos", "max_px")
        return min(most, self.of("town", "width_px")) if "town" in self.settings else most

    @property
    def view_px(self) -> int:
        """The pixels of a view in the data set."""
        return self.of("sampling", "width_px") * self.of("sampling", "height_px")

    @property
    def rendered(self) -> int:
        """The most views that may be rendered."""
        k = self.of("grouping", "k")
        return self.of("sampling", "domes") * (
            self.of("sampling", "views_per_dome") or (_LIKELY_K if k == "auto" else k)
        )


def _town(e: Extent) -> float:
    area_m2 = e.of("town", "length_m") * e.of("town", "width_m")
    return 0.5 * e.photos * e.of("town", "width_px") ** 2 + 450 * area_m2


def _photos(e: Extent) -> float:
    return 1.5 * e.photos * e.photo_px**2  # PNG of real surfaces


def _matching(e: Extent) -> float:
    return 270 * e.photos * e.of("matching", "max_features")


def _sfm(e: Extent) -> float:
    return _photos(e) + 80 * e.photos * e.of("matching", "max_features")


def _mapped_px(e: Extent) -> float:
    return e.photos * min(e.photo_px, e.of("depth", "max_px")) ** 2


_RULES: dict[str, Callable[[Extent], float]] = {
    "town": _town,
    "photos": _photos,
    "matching": _matching,
    "sfm": _sfm,
    "depth": lambda e: 16 * _mapped_px(e),  # a depth and three of the normal, in float32, at 3:4
    "surface": lambda e: 2 * _mapped_px(e) + 6 * _MIB,
    "rendering": lambda e: 6 * e.rendered * e.view_px,
    "dataset": lambda e: 4 * (e.photos + e.rendered) * e.view_px,
    # weights, and while it trains checkpoints with the optimiser's state
    "training": lambda e: 300 * _MIB if e.of("training", "encoder") == "resnet34" else 0.0,
}


def check_room(
    store: Store, scene: str, material: Material, config: SceneConfig, before: Mapping[str, Record], plan: Plan
) -> None:
    """Raise StoreError, naming what is needed, what is free and where, if a run cannot fit on the store's disk.

    `before` holds what the scene's last version is made of, by step.
    """
    try:
        to_write = bytes_to_write(material, config, before, plan)
    except InputError:
        return  # the stage that cannot read the photographs says so
    needed = sum(to_write.values()) + max(to_write.values(), default=0) + _SPARE_BYTES
    free = shutil.disk_usage(store.root).free
    if to_write and needed > free:
        most = sorted(to_write, key=lambda stage: -to_write[stage])[:_NAMED]
        raise StoreError(
            f"scene {scene!r} needs about {_told(needed)} on the disk of {store.root}, where {_told(free)} are free;"
            f" most of it for {', '.join(f'{stage} ({_told(to_write[stage])})' for stage in most)}",
            "make room with aug3d gc, choose another disk with --home DIR, or use a smaller preset",
        )


def bytes_to_write(material: Material, config: SceneConfig, before: Mapping[str, Record], plan: Plan) -> dict[str, int]:
    """Return about how many bytes the steps that are not in the store will write, by stage."""
    planned = list(plan)
    now = Extent(_photo_count(material, config, planned), _settings(material, config))
    then = _extent_of(before, now)
    folds = 1
    found: dict[str, int] = {}
    for step, record in planned:
        if step.stage == GROUPING and step.fold == 0 and record is None:
            folds = _likely_folds(now, before)  # the plan has only the first until the split is made
        if record is None:
            last = before.get(step.name) or before.get(step.stage.name)
            size = _rule(step.stage.name, now)
            if last is not None:
                size *= last.size_bytes / _rule(step.stage.name, then)
            found[step.stage.name] = found.get(step.stage.name, 0) + round(folds * size)
    return found


def _rule(stage: str, extent: Extent) -> float:
    return _LEAST_BYTES + (_RULES[stage](extent) if stage in _RULES else 0.0)


def _settings(material: Material, config: SceneConfig) -> dict[str, dict[str, Any]]:
    return config.model_dump(exclude={"auto", "town"} if material.photos else {"auto"})


def _extent_of(before: Mapping[str, Record], now: Extent) -> Extent:
    """Return the extent of an earlier version; what it does not tell is taken to be as now."""
    settings = {
        stage: {**fields, **(before[stage].config if stage in before else {})} for stage, fields in now.settings.items()
    }
    photos = before["photos"].metrics["photos"] if "photos" in before else None
    return Extent(int(photos or now.photos), settings)


def _photo_count(material: Material, config: SceneConfig, plan: Plan) -> int:
    if material.photos:
        return len(find_photos(material.photos).names)
    towns = [record for step, record in plan if step.stage.name == "town" and record]
    return int(towns[0].metrics["photos"] or 0) if towns else _flown(config.town)


def _flown(town: TownConfig) -> int:
    import numpy as np

    from aug3d_core.testbed.flight import plan_flight

    return len(plan_flight(town, np.random.default_rng(0)))


def _likely_folds(now: Extent, before: Mapping[str, Record]) -> int:
    if asked := now.of("grouping", "folds"):
        return asked
    share = now.of("grouping", "test_share")
    few = share * now.photos < _FEW_TESTS
    return max(fold_count(before), min(round(1 / share), now.photos // _LEAST_FOLD) if few else 1)


def _told(size_bytes: float) -> str:
    return f"{size_bytes / 2**30:.1f} GiB" if size_bytes >= 2**30 else f"{size_bytes / _MIB:.0f} MiB"
