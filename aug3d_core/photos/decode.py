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
from aug3d_core.run.memory import MemoryBudget, total_bytes
from aug3d_core.run.regular_file import opened

FORMATS = ("JPEG", "PNG", "TIFF")  # JPEG includes MPO, which some cameras write: its first picture is taken
_SHARPNESS_PX = 512
_BYTES_A_PIXEL = 12  # while it is decoded: as stored, in RGB, and on the way between, 4 each at the most
_BUDGET_SHARE = 0.25  # of the machine's memory, for all threads that decode
_STRIP_ROWS = 256


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


def decoding_budget() -> MemoryBudget:
    """Return the memory that all threads together may use to decode."""
    return MemoryBudget(int(_BUDGET_SHARE * total_bytes()))


def decode(source: Path, name: str, copy: Path, config: PhotosConfig, budget: MemoryBudget) -> Decoded:
    """Write the working copy of a photograph. Pixels stay as stored: the EXIF orientation is not applied.

    Its header says how much memory it will take, before any pixel is decoded.
    Raises RejectedError where the file is not a photograph that can be used.
    """
    if shown(name) != name:
        raise RejectedError("name: not UTF-8; rename the file")
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
    try:
        with opened(source) as file, Image.open(file, formats=FORMATS) as image:
            sha256 = _digest(file)
            original_size = image.size
            if min(original_size) < config.min_px:
                raise RejectedError(f"tiny: {image.width}x{image.height} px, shortest side under {config.min_px} px")
            exif = read_exif(image)
            # JPEG decodes at a fraction of its size for free; twice the target keeps the final Lanczos step in charge.
            image.draft("RGB", (2 * config.max_px, 2 * config.max_px))
            needed = _BYTES_A_PIXEL * image.width * image.height
            if needed > budget.total:
                raise RejectedError(
                    f"too large: {image.width}x{image.height} px take {needed / 2**30:.1f} GiB to decode; a quarter of the"
                    f" memory, {budget.total / 2**30:.1f} GiB, may be used"
                )
            held.enter_context(budget.taking(needed))
            return sha256, original_size, exif, _rgb(image)
    except (RejectedError, MemoryError):
        raise
    except Image.DecompressionBombError as error:
        raise RejectedError(f"too large: {error}") from error
    except Exception as error:  # Pillow raises whatever its parsers meet in damaged files, SyntaxError among them
        raise RejectedError(f"unreadable: {_reason(error)}") from error


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


def _rgb(image: Image.Image) -> Image.Image:
    if image.mode.startswith("I;16") or image.mode == "I":
        grey = np.empty((image.height, image.width), np.uint8)
        for top in range(0, image.height, _STRIP_ROWS):
            strip = image.crop((0, top, image.width, min(top + _STRIP_ROWS, image.height)))
            grey[top : top + _STRIP_ROWS] = np.asarray(strip).clip(0, 65535) // 257
        return Image.fromarray(grey).convert("RGB")
    return image.convert("RGB")


def _reason(error: Exception) -> str:
    if isinstance(error, Image.UnidentifiedImageError):
        return "not a JPEG, PNG or TIFF image"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror  # without the path, which differs between machines
    return str(error) or type(error).__name__
