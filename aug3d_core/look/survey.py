"""A folder of photographs as one look at each tells of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from aug3d_core.look.control import Listed, listed_points
from aug3d_core.look.glance import Glance, glances
from aug3d_core.look.ground import Ground, ground_of
from aug3d_core.look.neighbours import Step, steps_between
from aug3d_core.photos.config import PhotosConfig
from aug3d_core.photos.discover import find_photos
from aug3d_core.photos.foreign import foreign_pictures
from aug3d_core.photos.stage import capture_order, require_some


@dataclass(frozen=True)
class Survey:
    """photos: those that can be used, in the order of capture. steps: from each to the next.

    unusable: why others cannot be used, by name. same: names of later photographs with the same bytes as an earlier one.
    masked: photographs that have a mask. stray_masks: masks beside no photograph.
    ground: None without positions. control: None without a list of control points.
    """

    folder: Path
    photos: Sequence[Glance]
    steps: Sequence[Step]
    unusable: Mapping[str, str]
    same: Mapping[str, str]
    masked: Sequence[str]
    stray_masks: Sequence[str]
    ground: Ground | None
    control: Listed | None

    @cached_property
    def overlaps(self) -> Float[np.ndarray, " m"]:
        """How much of each photograph the next one shows too: by the ground of both where it is known, else by the pictures."""
        by_picture = np.array([step.overlap for step in self.steps])
        if self.ground is None:
            return by_picture
        known = np.isfinite(self.ground.corners_m).all(axis=(1, 2))
        return np.where(known[:-1] & known[1:], self.ground.common.diagonal(1), by_picture)

    @cached_property
    def lost(self) -> Bool[np.ndarray, " m"]:
        """Which photographs show nothing of the next one, nor by their ground of any other, as at the end of a line."""
        nothing = self.overlaps == 0
        return nothing if self.ground is None else nothing & (self.ground.common.sum(axis=1)[:-1] == 0)


def survey_of(folder: Path, progress: Callable[[int, int, str], None]) -> Survey:
    """Look at a folder; raises InputError if it is none, or holds no photograph."""
    found = find_photos(folder)
    require_some(folder, found)
    seen, unusable = glances(folder, found.names, PhotosConfig().min_px, progress)
    first: dict[str, str] = {}
    same = {one.name: first[one.sha256] for one in seen if first.setdefault(one.sha256, one.name) != one.name}
    foreign = foreign_pictures([one for one in seen if one.name not in same])
    unusable |= foreign
    photos = capture_order([one for one in seen if one.name not in same | foreign])
    steps = steps_between(photos)
    masked = [photo.name for photo in photos if photo.name in found.masks]
    ground = ground_of(photos, steps)
    control = listed_points(folder / found.control, photos) if found.control and photos else None
    return Survey(folder, photos, steps, unusable, same, masked, found.stray_masks, ground, control)
