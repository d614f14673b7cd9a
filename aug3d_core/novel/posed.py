"""A photograph that a nerfstudio `transforms.json` names, with its mask, packed as the stage dataset packs those of a scene."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, UInt8

from aug3d_core.dataset.images import fit
from aug3d_core.dataset.scene import FINER
from aug3d_core.geometry.camera_models import same_shape, scaled
from aug3d_core.geometry.masks import LEAST_USED
from aug3d_core.poses.entry import Entry
from aug3d_core.run.digest import file_digest
from aug3d_core.run.errors import InputError
from aug3d_core.run.memory import MemoryBudget
from aug3d_core.run.picture import PictureError, grey_of, opened_picture, rgb_of, take_memory


@dataclass(frozen=True)
class Posed:
    """A photograph at the packed size. Where it is masked, alpha is 0 and its colours are gone."""

    image: UInt8[np.ndarray, "h w 3"]
    fine_image: UInt8[np.ndarray, "h2 w2 3"]
    alpha: UInt8[np.ndarray, "h w"]
    intrinsics: Float[np.ndarray, " 4"]  # fx, fy, cx, cy in px


def posed_digest(file: Path, entry: Entry) -> str:
    """Digest of a photograph and its mask; raises InputError if one is missing."""
    photo, mask = _photo_file(file, entry), _mask_file(file, entry)
    try:
        digest = file_digest(photo)
    except OSError as error:
        raise _unusable(photo, entry, error.strerror or str(error)) from error
    if mask is None:
        return digest
    try:
        return digest + file_digest(mask)
    except (OSError, ValueError) as error:
        raise _unusable_mask(mask, entry, getattr(error, "strerror", None) or str(error)) from error


def posed(file: Path, entry: Entry, size_px: tuple[int, int], budget: MemoryBudget) -> Posed:
    """Read a photograph and pack it to a size (width, height).

    Raises InputError for one that is missing, distorted, or not of its camera's shape, and for a mask that is missing, lies
    outside the folder of the poses, has another size than its photograph, or leaves nothing of it.
    """
    _, camera = entry.names[0]
    if camera.model != "PINHOLE":
        raise InputError(
            f"{entry.where} is distorted (camera model {camera.model})",
            "give undistorted photographs and their cameras",
        )
    rgb = _photograph(_photo_file(file, entry), entry, budget)
    height, width = rgb.shape[:2]
    if not same_shape(camera, width, height):
        raise InputError(
            f"{entry.where}: the photograph is {width}x{height} px, its camera is of {camera.width}x{camera.height}",
            "give the photograph that the camera belongs to, or a copy resized without cropping",
        )
    crop = fit(width, height, *size_px)
    fine, intrinsics = crop.times(FINER), crop.intrinsics(np.array(scaled(camera, width, height).params))
    mask = _mask_file(file, entry)
    if mask is None:
        return Posed(crop.colour(rgb), fine.colour(rgb), np.full(size_px[::-1], 255, np.uint8), intrinsics)
    used = _used(mask, entry, (width, height), budget)
    alpha = crop.alpha(used)
    if not alpha.any():
        raise _unusable_mask(mask, entry, f"it leaves nothing of the photograph at {size_px[0]}x{size_px[1]} px")
    return Posed(crop.masked(rgb, used), fine.masked(rgb, used), alpha, intrinsics)


def _photograph(photo: Path, entry: Entry, budget: MemoryBudget) -> UInt8[np.ndarray, "h w 3"]:
    try:
        with ExitStack() as held, opened_picture(photo) as (_, image):
            take_memory(image, budget, held)
            return np.asarray(rgb_of(image))
    except PictureError as error:
        raise _unusable(photo, entry, str(error)) from error


def _used(mask: Path, entry: Entry, size_px: tuple[int, int], budget: MemoryBudget) -> Bool[np.ndarray, "h w"]:
    """Return which pixels of a photograph of this size are used; what is transparent in its mask is not."""
    try:
        with ExitStack() as held, opened_picture(mask) as (_, image):
            if image.size != size_px:
                raise PictureError(
                    f"it is {image.width}x{image.height} px, the photograph {size_px[0]}x{size_px[1]} px"
                )
            take_memory(image, budget, held)
            return np.asarray(grey_of(image)) >= LEAST_USED
    except PictureError as error:
        raise _unusable_mask(mask, entry, str(error)) from error


def _photo_file(file: Path, entry: Entry) -> Path:
    try:
        path = file.parent / entry.names[0][0]
        path.stat()
    except FileNotFoundError as error:
        raise InputError(
            f"{entry.where}: the photograph {path} does not exist", "put it there, or mend file_path"
        ) from error
    except (OSError, ValueError) as error:  # too long a name, a loop of links, a character that no name can hold
        raise InputError(f"{entry.where}: file_path names no file ({error})", "mend file_path") from error
    return path


def _mask_file(file: Path, entry: Entry) -> Path | None:
    if entry.mask is None:
        return None
    path = Path(entry.mask)
    if path.is_absolute() or ".." in path.parts:
        raise _unusable_mask(path, entry, f"its path leads out of the folder of {file.name}")
    return file.parent / path


def _unusable(photo: Path, entry: Entry, why: str) -> InputError:
    return InputError(f"{entry.where}: the photograph {photo} cannot be used ({why})", "copy it again, or take it out")


def _unusable_mask(mask: Path, entry: Entry, why: str) -> InputError:
    return InputError(
        f"{entry.where}: the mask {mask} cannot be used ({why})",
        f"black is left out and white is used, from {LEAST_USED} of 255 on: make it again, or take mask_path out",
    )
