"""Decode one photograph into its working copy, or say why it cannot be used."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image

from aug3d_core.photos.config import PhotosConfig
from aug3d_core.photos.exif import Exif, read_exif
from aug3d_core.run.digest import file_digest

FORMATS = ("JPEG", "PNG", "TIFF")  # JPEG includes MPO, which some cameras write: its first picture is taken
_SHARPNESS_PX = 512


class RejectedError(Exception):
    """The photograph cannot be used; the message is the reason that the user reads."""


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


def decode(source: Path, name: str, copy: Path, config: PhotosConfig) -> Decoded:
    """Write the working copy of a photograph. Pixels stay as stored: the EXIF orientation is not applied.

    Raises RejectedError where the file is not a photograph that can be used.
    """
    if shown(name) != name:
        raise RejectedError("name: not UTF-8; rename the file")
    try:
        sha256 = file_digest(source)
        with Image.open(source, formats=FORMATS) as image:
            original_size = image.size
            if min(original_size) < config.min_px:
                raise RejectedError(f"tiny: {image.width}x{image.height} px, shortest side under {config.min_px} px")
            exif = read_exif(image)
            # JPEG decodes at a fraction of its size for free; twice the target keeps the final Lanczos step in charge.
            image.draft("RGB", (2 * config.max_px, 2 * config.max_px))
            pixels = _rgb(image)
    except (RejectedError, MemoryError):
        raise
    except Image.DecompressionBombError as error:
        raise RejectedError(f"too large: {error}") from error
    except Exception as error:  # Pillow raises whatever its parsers meet in damaged files, SyntaxError among them
        raise RejectedError(f"unreadable: {_reason(error)}") from error
    pixels_sha256 = hashlib.sha256(repr(pixels.size).encode() + pixels.tobytes()).hexdigest()
    pixels.thumbnail((config.max_px, config.max_px), Image.Resampling.LANCZOS)
    pixels.save(copy, format="PNG", compress_level=1)
    sharpness = measure_sharpness(np.asarray(pixels))
    return Decoded(name, copy, exif, original_size, pixels.size, sharpness, sha256, pixels_sha256)


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


def _rgb(image: Image.Image) -> Image.Image:
    if image.mode.startswith("I;16") or image.mode == "I":
        return Image.fromarray((np.asarray(image).clip(0, 65535) // 257).astype(np.uint8)).convert("RGB")
    return image.convert("RGB")


def _reason(error: Exception) -> str:
    if isinstance(error, Image.UnidentifiedImageError):
        return "not a JPEG, PNG or TIFF image"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror  # without the path, which differs between machines
    return str(error) or type(error).__name__
