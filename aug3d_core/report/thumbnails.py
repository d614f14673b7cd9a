"""Small copies of pictures, for places that embed them."""

from __future__ import annotations

import io
from pathlib import Path

from PIL import Image

_LONGEST_PX = 1000


def is_film(picture: str | Path) -> bool:
    """Return whether a stage's picture is a film: browsers play it, and it has no small copy."""
    return Path(picture).suffix == ".webm"


def thumbnail_jpeg(picture: Path) -> bytes:
    """Return a JPEG of at most 1000 px on its longest side."""
    with Image.open(picture) as image:
        small = image.convert("RGB")
        small.thumbnail((_LONGEST_PX, _LONGEST_PX))
    return encoded(small, "JPEG", quality=85)


def encoded(image: Image.Image, kind: str, **options: int | bool) -> bytes:
    """Return a picture as the bytes of a file of this kind."""
    buffer = io.BytesIO()
    image.save(buffer, kind, **options)
    return buffer.getvalue()
