"""A decision about a setting, and what it was taken from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.factory.config import SceneConfig
from aug3d_core.factory.material import Material
from aug3d_core.photos.discover import find_photos
from aug3d_core.run.stage import Decision, Metric, StageConfig
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store


@dataclass(frozen=True)
class Settled:
    """The settings of a stage with nothing left open, and why those that were open are as they are."""

    config: StageConfig
    decisions: tuple[Decision, ...] = ()


@dataclass(frozen=True)
class Known:
    """What is known of a scene when a stage's turn comes: what the user gave and set, and what is made so far, by stage."""

    config: SceneConfig
    records: Mapping[str, Record]
    store: Store
    material: Material

    def metric(self, stage: str, name: str) -> Metric:
        """Return a figure of a stage, None if the stage is not made or tells none."""
        return self.records[stage].metrics.get(name) if stage in self.records else None

    def figure(self, stage: str, name: str) -> float | None:
        """Return a figure of a stage as a number, None if there is none."""
        value = self.metric(stage, name)
        return float(value) if isinstance(value, int | float) else None

    def folder(self, stage: str, *reads: str) -> Path | None:
        """Return where the named files of a stage are, None if it is not made."""
        return self.store.files_dir(self.records[stage], reads) if stage in self.records else None

    @property
    def photos(self) -> int | None:
        """The number of photographs, None while the town is not flown; raises InputError if the folder is none."""
        if self.material.elsewhere:
            return self.material.elsewhere.photo_count
        if self.material.photos:
            return len(find_photos(self.material.photos).names)
        count = self.figure("town", "photos")
        return None if count is None else int(count)

    @property
    def training_photos(self) -> int | None:
        """How many photographs are worth training on; None before the split."""
        count = self.figure("grouping", "worth_training_on")
        return None if count is None else int(count)

    @cached_property
    def photo_sizes(self) -> Int[np.ndarray, "n 2"] | Float[np.ndarray, "n 2"]:
        """Width and height that photographs are worked on with, px; while none is read, what they are at most."""
        from aug3d_core.photos.files import PHOTO_TABLE, read_photos

        folder = self.folder("photos", PHOTO_TABLE)
        if folder is None:
            return np.full((1, 2), self.config.photos.max_px)
        return read_photos(folder)[["width_px", "height_px"]].to_numpy()

    @property
    def photo_px(self) -> int:
        """The width of the widest photograph as it is worked on, px."""
        return int(self.photo_sizes[:, 0].max())

    @property
    def photo_over_view(self) -> float:
        """The pixels of a photograph along a side of a packed view's pixel: of the median one, cropped as it is packed."""
        packed = self.config.dataset
        return float(np.median((self.photo_sizes / [packed.width_px, packed.height_px]).min(axis=1)))
