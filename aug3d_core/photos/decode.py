"""Decode one photograph into its working copy, or say why it cannot be used."""

from __future__ import annotations

import hashlib
import io
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image

from aug3d_core.photos.config import PhotosConfig
from aug3d_core.photos.exif import Exif, read_exif
from aug3d_core.run.memory import MemoryBudget
from aug3d_core.run.picture import PictureError, opened_picture, rgb_of, take_memory

_SHARPNESS_PX = 512
_STRIP_ROWS = 256


@dataclass(frozen=True)
class Decoded:
    """A usable photograph, its working copy already on disk."""

    name: str
    copy: Path
    exif: Exif
    original_size: tuple[int, int]  # width, height in px
    size: tuple[int, int]  # of the working copy
    sharpness: float
    sha256: str
    pixels_sha256: str


def decode(source: Path, name: str, copy: Path, config: PhotosConfig, budget: MemoryBudget) -> Decoded:
    """Write the working copy of a photograph. Pixels stay as stored: the EXIF orientation is not applied.

    Its header says how much memory it will take, before any pixel is decoded.
    Raises PictureError where the file is not a photograph that can be used.
    """
    if shown(name) != name:
        raise PictureError("name: not UTF-8; rename the file")
    with ExitStack() as held:
        sha256, original_size, exif, pixels = _read(source, config, budget, held)
        pixels_sha256 = _pixels_digest(pixels)
        pixels.thumbnail((config.max_px, config.max_px), Image.Resampling.LANCZOS)
        pixels.save(copy, format="PNG", compress_level=1)
        sharpness = measure_sharpness(np.asarray(pixels))
    return Decoded(name, copy, exif, original_size, pixels.size, sharpness, sha256, pixels_sha256)


def _read(
    source: Path, config: PhotosConfig, budget: MemoryBudget, held: ExitStack
) -> tuple[str, tuple[int, int], Exif, Image.Image]:
    """Return digest, stored size, EXIF and RGB pixels of a photograph; `held` then holds the memory that they need."""
    with opened_picture(source) as (file, image):
        sha256 = _digest(file)
        original_size = image.size
        if min(original_size) < config.min_px:
            raise PictureError(f"tiny: {image.width}x{image.height} px, shortest side under {config.min_px} px")
        # JPEG decodes at a fraction of its size for free; twice the target keeps the final Lanczos step in charge.
        image.draft("RGB", (2 * config.max_px, 2 * config.max_px))
        take_memory(image, budget, held)
        exif = read_exif(image, original_size)
        return sha256, original_size, exif, rgb_of(image)


def _digest(file: io.BufferedReader) -> str:
    """Return the SHA-256 of an open file, whose place stays where it was."""
    at = file.tell()
    file.seek(0)
    digest = hashlib.file_digest(file, "sha256").hexdigest()
    file.seek(at)
    return digest


def _pixels_digest(pixels: Image.Image) -> str:
    digest = hashlib.sha256(repr(pixels.size).encode())
    for top in range(0, pixels.height, _STRIP_ROWS):
        digest.update(pixels.crop((0, top, pixels.width, min(top + _STRIP_ROWS, pixels.height))).tobytes())
    return digest.hexdigest()


def shown(name: str) -> str:
    """Return a file name as text: bytes that are not UTF-8, which Python keeps as surrogates, are written out."""
    return name.encode(errors="surrogateescape").decode(errors="backslashreplace")


def measure_sharpness(rgb: UInt8[np.ndarray, "h w 3"]) -> float:
    """Return the variance of the Laplacian of the grey image (0..255), its longest side brought to 512 px first."""
    grey = Image.fromarray(rgb).convert("L")
    scale = _SHARPNESS_PX / max(grey.size)
    size = max(3, round(grey.width * scale)), max(3, round(grey.height * scale))
    return float(np.var(_laplacian(np.asarray(grey.resize(size, Image.Resampling.LANCZOS), np.float64))))


def _laplacian(grey: Float[np.ndarray, "h w"]) -> Float[np.ndarray, "h-2 w-2"]:
    around = grey[:-2, 1:-1] + grey[2:, 1:-1] + grey[1:-1, :-2] + grey[1:-1, 2:]
    return around - 4 * grey[1:-1, 1:-1]
