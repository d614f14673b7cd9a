"""Open and decode a user's picture: a regular file, within a stated share of the memory, as 8-bit RGB.

Pixels and size are as stored in every format: no EXIF orientation is applied.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
from PIL import Image
from PIL.TiffImagePlugin import TiffImageFile

from aug3d_core.run.memory import MemoryBudget, total_bytes
from aug3d_core.run.regular_file import opened

FORMATS = ("JPEG", "PNG", "TIFF")  # JPEG includes MPO, which some cameras write: its first picture is taken
_BYTES_A_PIXEL = 12  # while it is decoded: as stored, in RGB, and on the way between, 4 each at the most
_BUDGET_SHARE = 0.25  # of the machine's memory, for all threads that decode
_STRIP_ROWS = 256


class PictureError(Exception):
    """The file is no picture that can be used; the message says why, without its path."""


def decoding_budget() -> MemoryBudget:
    """Return the memory that all threads together may use to decode."""
    return MemoryBudget(int(_BUDGET_SHARE * total_bytes()))


@contextmanager
def opened_picture(path: Path) -> Iterator[tuple[io.BufferedReader, Image.Image]]:
    """Open a picture's file and its header; what goes wrong while it is open becomes a PictureError."""
    try:
        with opened(path) as file, Image.open(file, formats=FORMATS) as image:
            if isinstance(image, TiffImageFile):
                _keep_unturned(image)
            yield file, image
    except (PictureError, MemoryError):
        raise
    except Image.DecompressionBombError as error:
        raise PictureError(f"too large: {error}") from error
    except Exception as error:  # Pillow raises whatever its parsers meet in damaged files, SyntaxError among them
        raise PictureError(f"unreadable: {_reason(error)}") from error


def _keep_unturned(image: TiffImageFile) -> None:
    """Let an opened TIFF keep its stored size and pixels, which Pillow turns by the orientation, as in no other format here."""
    image._size = image._tile_size  # Pillow has exchanged width and height for a quarter turn
    image.load_end = lambda: None  # what turns the decoded pixels


def take_memory(image: Image.Image, budget: MemoryBudget, held: ExitStack) -> None:
    """Let `held` hold the memory that an opened picture needs to be decoded, by its header.

    To be called before anything that may decode it. Raises PictureError if it needs more than may be used.
    """
    needed = _BYTES_A_PIXEL * image.width * image.height
    if needed > budget.total:
        raise PictureError(
            f"too large: {image.width}x{image.height} px take {needed / 2**30:.1f} GiB to decode; a quarter of the"
            f" memory, {budget.total / 2**30:.1f} GiB, may be used"
        )
    held.enter_context(budget.taking(needed))


def rgb_of(image: Image.Image) -> Image.Image:
    """Decode a picture for which memory was taken, to 8-bit RGB; raises PictureError where its numbers have no known range."""
    if image.mode == "F":
        raise PictureError("floating-point pixels: convert it to 8 or 16 bits a channel")
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


def grey_of(image: Image.Image) -> Image.Image:
    """Return a decoded mask as 8-bit grey; what is transparent is black."""
    if "A" in image.mode or "transparency" in image.info:
        cover = image.convert("RGBA")
        return Image.alpha_composite(Image.new("RGBA", cover.size, (0, 0, 0, 255)), cover).convert("L")
    return rgb_of(image).convert("L")
