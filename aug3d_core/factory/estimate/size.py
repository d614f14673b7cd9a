"""How large a scene is, as far as that is known before it is made."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from aug3d_core.factory.config import SceneConfig
from aug3d_core.factory.material import Material
from aug3d_core.photos.discover import find_photos
from aug3d_core.photos.files import PHOTO_IMAGES
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store

_LOOKED_AT = 12  # photographs whose headers are read
_USUAL_PX = 12_000_000.0  # where nothing tells
_USUAL_ASPECT = 4 / 3


@dataclass(frozen=True)
class SceneSize:
    """What a scene is made of: photographs, the pixels of the median one as it was given, and whether they tell GPS positions.

    aspect: width over height, as it is stored.
    """

    photos: int
    photo_px: float
    gps: bool = True
    aspect: float = _USUAL_ASPECT

    @property
    def width_px(self) -> float:
        """The width of the median photograph as it was given, px."""
        return math.sqrt(self.photo_px * self.aspect)

    @property
    def height_px(self) -> float:
        """Its height, px."""
        return math.sqrt(self.photo_px / self.aspect)


def size_of(
    material: Material, config: SceneConfig, made: Mapping[str, Record], store: Store | None = None
) -> SceneSize:
    """Return the size of a scene; raises InputError for a folder that is none.

    made: what is there of it already, by step. store: where that is.
    """
    if "photos" in made:
        return size_of_record(made["photos"], store)
    if material.photos:
        return _size_of_folder(material.photos)
    return SceneSize(_town_photos(config), config.town.width_px * config.town.height_px, config.town.gps)


def size_of_record(photos: Record, store: Store | None = None) -> SceneSize:
    """Return the size of a scene whose photographs were read. store: where their copies are, which alone tell the aspect."""
    count, megapixels, with_gps = (
        float(photos.metrics.get(name) or 0) for name in ("photos", "megapixels_median", "with_gps")
    )
    aspect = _aspect_of_copies(photos, store) if store else _USUAL_ASPECT
    return SceneSize(int(count), megapixels * 1e6 or _USUAL_PX, with_gps >= 2, aspect)


def _size_of_folder(folder: Path) -> SceneSize:
    """Look at the headers of a few photographs: they are alike, or their stage tells."""
    from aug3d_core.photos.exif import read_exif  # with Pillow, which most commands do without
    from aug3d_core.run.picture import PictureError, opened_picture

    names = find_photos(folder).names
    sizes, located = [], 0
    for name in _a_few(names):
        try:
            with opened_picture(folder / name) as (_, image):
                sizes.append(image.size)
                located += image.format != "PNG" and math.isfinite(read_exif(image, image.size).lat_deg)
        except PictureError:
            continue  # the stage `photos` tells of it
    pixels = sorted(width * height for width, height in sizes)
    return SceneSize(len(names), pixels[len(pixels) // 2] if pixels else _USUAL_PX, located >= 2, _median_aspect(sizes))


def _aspect_of_copies(photos: Record, store: Store) -> float:
    """Look at the headers of a few copies that are here. An estimate alters nothing in the store: no digest is compared."""
    from aug3d_core.run.picture import PictureError, opened_picture

    sizes = []
    for name in _a_few([name for name in photos.files if name.startswith(f"{PHOTO_IMAGES}/")]):
        try:
            with opened_picture(store.place(photos) / name) as (_, image):
                sizes.append(image.size)
        except PictureError:
            continue
    return _median_aspect(sizes)


def _a_few(names: Sequence[str]) -> Sequence[str]:
    return names[:: math.ceil(len(names) / _LOOKED_AT) or 1]


def _median_aspect(sizes: Sequence[tuple[int, int]]) -> float:
    return median([width / height for width, height in sizes] or [_USUAL_ASPECT])


def _town_photos(config: SceneConfig) -> int:
    import numpy as np

    from aug3d_core.town.drone.flight import plan_flight

    return len(plan_flight(config.town, np.random.default_rng(0)))
