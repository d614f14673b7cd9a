"""The masks beside photographs: what of each is not to be used. A mask that is not understood stops the run: to go on without
it would match, train on and score what the user has ruled out.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from PIL import Image

from aug3d_core.geometry.masks import LEAST_USED, save_mask
from aug3d_core.photos.decode import Decoded, shown
from aug3d_core.photos.discover import Found
from aug3d_core.photos.files import mask_path
from aug3d_core.run.errors import InputError
from aug3d_core.run.memory import MemoryBudget
from aug3d_core.run.picture import PictureError, decoding_budget, grey_of, opened_picture, take_memory

_NAMED = 5


def write_masks(folder: Path, masks: Mapping[str, str], photos: Sequence[Decoded], out: Path) -> dict[str, float]:
    """Write the working copy of each mask beside those of the photographs, which are in the order of their ids.

    masks: by photograph, paths relative to the folder. Returns by photograph the share of its pixels that is masked. Raises
    InputError for a mask that cannot be read, has another size than its photograph, or leaves nothing of it.
    """
    budget = decoding_budget()
    named = [(photo_id, photo) for photo_id, photo in enumerate(photos) if photo.name in masks]

    def one(numbered: tuple[int, Decoded]) -> float:
        photo_id, photo = numbered
        return _write_mask(folder / masks[photo.name], photo, mask_path(out, photo_id), budget)

    with warnings.catch_warnings(), ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        warnings.simplefilter("ignore")  # as for photographs: Pillow's of large pictures and corrupt EXIF
        return dict(zip([photo.name for _, photo in named], pool.map(one, named), strict=True))


def mask_notes(found: Found, used: Collection[str]) -> list[str]:
    """Say which masks do nothing. used: the photographs of those that do something."""
    notes = []
    if found.stray_masks:
        stray = ", ".join(map(shown, found.stray_masks[:_NAMED])) + (", ..." if len(found.stray_masks) > _NAMED else "")
        notes.append(
            f"{len(found.stray_masks)} masks lie beside no photograph and mask nothing (that of IMG_1.JPG is IMG_1_mask.png):"
            f" {stray}"
        )
    if idle := len(found.masks) - len(used):
        notes.append(f"{idle} masks are of photographs that are not used")
    return notes


def _write_mask(source: Path, photo: Decoded, copy: Path, budget: MemoryBudget) -> float:
    """Write the working copy of a mask: a pixel is used where half of it or more is."""
    name = shown(source.name)
    try:
        with ExitStack() as held, opened_picture(source) as (_, image):
            if image.size != photo.original_size:
                raise PictureError(
                    f"it is {image.width}x{image.height} px, the photograph {photo.original_size[0]}x"
                    f"{photo.original_size[1]} px as it is stored"
                )
            take_memory(image, budget, held)
            whole = Image.fromarray(np.where(np.asarray(grey_of(image)) >= LEAST_USED, np.uint8(255), np.uint8(0)))
            used = np.asarray(whole.resize(photo.size, Image.Resampling.BOX)) >= LEAST_USED
    except PictureError as error:
        raise InputError(
            f"the mask {name} of photograph {photo.name} cannot be used: {error}",
            "Make it again, in the size of the photograph and not turned by its EXIF orientation, or take it out.",
        ) from error
    if not used.any():
        raise InputError(
            f"the mask {name} leaves nothing of photograph {photo.name}",
            f"Black is left out and white is used, from {LEAST_USED} of 255 on: mend the mask, or take the photograph out.",
        )
    save_mask(used, copy)
    return float(1 - used.mean())
