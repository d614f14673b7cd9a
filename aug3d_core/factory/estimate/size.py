"""How large a scene is, as far as that is known before it is made."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from aug3d_core.factory.config import SceneConfig
from aug3d_core.factory.material import Material
from aug3d_core.photos.discover import find_photos
from aug3d_core.store.record import Record

_LOOKED_AT = 12  # photographs whose headers are read
_USUAL_PX = 12_000_000.0  # where nothing tells


@dataclass(frozen=True)
class SceneSize:
    """What a scene is made of: photographs, the pixels of one as it was given, and whether they tell positions by GPS."""

    photos: int
    photo_px: float
    gps: bool = True


def size_of(material: Material, config: SceneConfig, made: Mapping[str, Record]) -> SceneSize:
    """Return the size of a scene; raises InputError for a folder that is none. made: what is there of it already, by step."""
    if "photos" in made:
        return size_of_record(made["photos"])
    if material.photos:
        return _size_of_folder(material.photos)
    return SceneSize(_town_photos(config), config.town.width_px * config.town.height_px, config.town.gps)


def size_of_record(photos: Record) -> SceneSize:
    """Return the size of a scene whose photographs were read."""
    count, megapixels, with_gps = (
        float(photos.metrics.get(name) or 0) for name in ("photos", "megapixels_median", "with_gps")
    )
    return SceneSize(int(count), megapixels * 1e6 or _USUAL_PX, with_gps >= 2)


def _size_of_folder(folder: Path) -> SceneSize:
    """Look at the headers of a few photographs: they are alike, or their stage tells."""
    from aug3d_core.photos.exif import read_exif  # with Pillow, which most commands do without
    from aug3d_core.run.picture import PictureError, opened_picture

    names = find_photos(folder).names
    pixels, located = [], 0
    for name in names[:: math.ceil(len(names) / _LOOKED_AT) or 1]:
        try:
            with opened_picture(folder / name) as (_, image):
                pixels.append(image.width * image.height)
                located += image.format != "PNG" and math.isfinite(read_exif(image, image.size).lat_deg)
        except PictureError:
            continue  # the stage `photos` tells of it
    return SceneSize(len(names), sorted(pixels)[len(pixels) // 2] if pixels else _USUAL_PX, located >= 2)


def _town_photos(config: SceneConfig) -> int:
    import numpy as np

    from aug3d_core.town.drone.flight import plan_flight

    return len(plan_flight(config.town, np.random.default_rng(0)))
