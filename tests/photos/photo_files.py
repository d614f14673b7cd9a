"""Photographs for tests, written with the EXIF that a camera would write."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from PIL import ExifTags, Image
from PIL.TiffImagePlugin import IFDRational


def pixels(seed: int = 0, size: tuple[int, int] = (320, 240)) -> Image.Image:
    """Return a photograph-like picture: noise at several scales."""
    rng = np.random.default_rng(seed)
    grey = np.zeros((size[1], size[0]))
    for scale in (4, 16, 64):
        coarse = Image.fromarray(rng.integers(0, 256, (scale, scale), dtype=np.uint8))
        grey += np.asarray(coarse.resize(size, Image.Resampling.BICUBIC), float) / 3
    return Image.fromarray(grey.clip(0, 255).astype(np.uint8)).convert("RGB")


def write_photo(
    path: Path,
    seed: int = 0,
    size: tuple[int, int] = (320, 240),
    detail: dict[int, Any] | None = None,
    gps: dict[int, Any] | None = None,
    main: dict[int, Any] | None = None,
) -> Path:
    """Write a photograph with the given EXIF tags."""
    exif = Image.Exif()
    exif.update(main or {})
    exif.get_ifd(ExifTags.IFD.Exif).update(detail or {})
    exif.get_ifd(ExifTags.IFD.GPSInfo).update(gps or {})
    path.parent.mkdir(parents=True, exist_ok=True)
    pixels(seed, size).save(path, exif=exif)
    return path


def degrees(value: float) -> tuple[IFDRational, IFDRational, IFDRational]:
    """Return degrees, minutes and seconds as EXIF holds them."""
    value = abs(value)
    minutes = value % 1 * 60
    return IFDRational(int(value)), IFDRational(int(minutes)), IFDRational(round(minutes % 1 * 60 * 10_000), 10_000)
