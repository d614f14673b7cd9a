"""What one look at a photograph tells: its header, how sharp and how bright it is, and its features."""

from __future__ import annotations

import hashlib
import os
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from aug3d_core.look.neighbours import Sketch, sketch_of
from aug3d_core.photos.decode import measure_sharpness, shown
from aug3d_core.photos.exif import Exif, read_exif
from aug3d_core.photos.xmp import Attitude, read_attitude
from aug3d_core.report.thumbnails import encoded
from aug3d_core.run.memory import MemoryBudget
from aug3d_core.run.picture import PictureError, decoding_budget, opened_picture, rgb_of, take_memory

LOOKED_AT_PX = 512  # longest side
_DECODED_PX = (512, 384)  # JPEG decodes to no less than this, at an eighth of its size for most cameras
_THUMBNAIL_PX, _QUALITY = 200, 70
_WHITE = 250  # of 255: no detail above it


@dataclass(frozen=True)
class Glance(Sketch):
    """A photograph that can be used.

    original_size: as stored. brightness: mean of the grey picture in [0, 1]. white: share of it without detail. thumbnail: a
    JPEG file. The small copy has LOOKED_AT_PX.
    """

    name: str
    original_size: tuple[int, int]
    exif: Exif
    attitude: Attitude
    sha256: str
    sharpness: float
    brightness: float
    white: float
    thumbnail: bytes


def glances(
    folder: Path, names: Sequence[str], least_px: int, progress: Callable[[int, int, str], None]
) -> tuple[list[Glance], dict[str, str]]:
    """Look at every photograph; return those that can be used, and why others cannot, by name.

    least_px: the shortest side of a photograph that can be used.
    """
    budget = decoding_budget()

    def one(name: str) -> Glance | str:
        try:
            return _glance(folder / name, name, least_px, budget)
        except PictureError as error:
            return str(error)

    found, unusable = [], {}
    with warnings.catch_warnings(), ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        warnings.simplefilter("ignore")  # Pillow's, of large pictures and of corrupt EXIF
        for done, (name, seen) in enumerate(zip(names, pool.map(one, names), strict=True), start=1):
            if isinstance(seen, Glance):
                found.append(seen)
            else:
                unusable[shown(name)] = seen
            progress(done, len(names), "photographs")
    return found, unusable


def _glance(path: Path, name: str, least_px: int, budget: MemoryBudget) -> Glance:
    if shown(name) != name:
        raise PictureError("name: not UTF-8; rename the file")
    with opened_picture(path) as (file, image), ExitStack() as held:
        original_size = image.size
        if min(original_size) < least_px:
            raise PictureError(f"tiny: {original_size[0]}x{original_size[1]} px, shortest side under {least_px} px")
        attitude = read_attitude(image)
        at = file.tell()
        file.seek(0)
        sha256 = hashlib.file_digest(file, "sha256").hexdigest()
        file.seek(at)
        image.draft("RGB", _DECODED_PX)
        take_memory(image, budget, held)
        exif = read_exif(image, original_size)
        pixels = rgb_of(image)
    pixels.thumbnail((LOOKED_AT_PX, LOOKED_AT_PX), Image.Resampling.BOX)
    grey = np.asarray(pixels.convert("L"))
    thumbnail = pixels.copy()
    thumbnail.thumbnail((_THUMBNAIL_PX, _THUMBNAIL_PX), Image.Resampling.LANCZOS)
    return Glance(
        **vars(sketch_of(grey)),
        name=name,
        original_size=original_size,
        exif=exif,
        attitude=attitude,
        sha256=sha256,
        sharpness=measure_sharpness(np.asarray(pixels)),
        brightness=float(grey.mean()) / 255,
        white=float((grey >= _WHITE).mean()),
        thumbnail=encoded(thumbnail, "JPEG", quality=_QUALITY),
    )
