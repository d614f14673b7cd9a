"""Damage to photographs as files, and to what their EXIF is taken to say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float, UInt8
from PIL import Image
from scipy.ndimage import gaussian_filter

from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Views
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.town.drone.sensor import blur as blurred
from aug3d_core.town.drone.sensor import expose
from aug3d_core.town.files import TOWN_PHOTOS, TRUTH_POSES

_QUALITY = 95  # of a JPEG
_NOISE_LEVELS = 1.3  # of 255: as the town's camera has; a filter takes it out, a worse lens would not
_HAZE_PX = 12.0  # detail finer than this fades

Picture = UInt8[np.ndarray, "h w 3"]


def blur(folder: Path, dose: float, rng: np.random.Generator) -> None:
    """Blur the town's photographs by a Gaussian of `dose` px."""
    _develop(folder, rng, lambda rgb, _number, _count: blurred(rgb, dose))


def brighten(folder: Path, dose: float, rng: np.random.Generator) -> None:
    """Let `dose` times the light onto the sensor from the middle of the flight on."""
    _develop(folder, rng, lambda rgb, number, count: expose(rgb, dose if 2 * number >= count else 1.0))


def fade(folder: Path, dose: float, rng: np.random.Generator) -> None:
    """Leave this share of the contrast of everything fine; the sensor's noise stays as it is."""

    def faded(rgb: Picture, _number: int, _count: int) -> Picture:
        smooth = gaussian_filter(rgb.astype(float), (_HAZE_PX, _HAZE_PX, 0), mode="nearest")
        return np.rint(smooth + dose * (rgb - smooth)).clip(0, 255).astype(np.uint8)

    _develop(folder, rng, faded)


def tear_apart(folder: Path, dose: float, rng: np.random.Generator) -> None:
    """Take out the photographs taken within `dose` metres about the flight's middle, from west to east; and their truth."""
    truth = Views.load(folder / TRUTH_POSES)
    x = centres(truth.cam_from_world)[:, 0]
    kept = np.abs(x - (x.min() + x.max()) / 2) >= dose / 2
    for photo, stays in zip(_photos(folder), kept, strict=True):
        if not stays:
            photo.unlink()
    left = truth.take(np.flatnonzero(kept))
    replace(left, photo_id=np.arange(len(left))).save(folder / TRUTH_POSES)


def wrong_focal(folder: Path, dose: float, rng: np.random.Generator) -> None:
    """Take EXIF to state `dose` times the focal length in the photo table."""
    table = pd.read_parquet(folder / PHOTO_TABLE)
    table.assign(focal_px=table["focal_px"] * dose).to_parquet(folder / PHOTO_TABLE)


def _develop(folder: Path, rng: np.random.Generator, change: Callable[[Picture, int, int], Picture]) -> None:
    """Change every photograph, by its number in the flight; undisturbed ones pass through the same sensor and file."""
    photos = _photos(folder)
    for number, path in enumerate(photos):
        with Image.open(path) as image:
            exif, rgb = image.getexif(), np.asarray(image.convert("RGB"))
        changed = change(rgb, number, len(photos))
        noisy: Float[np.ndarray, "h w 3"] = changed + rng.normal(0, _NOISE_LEVELS, changed.shape)
        Image.fromarray(np.rint(noisy).clip(0, 255).astype(np.uint8)).save(path, exif=exif, quality=_QUALITY)


def _photos(folder: Path) -> list[Path]:
    return sorted((folder / TOWN_PHOTOS).iterdir())
