"""Small JPEG copies of pictures, for places that embed them."""

from __future__ import annotations

import io
from pathlib import Path

from PIL import Image


def thumbnail_jpeg(picture: Path, max_px: int = 1000) -> bytes:
    """Return a JPEG no larger than `max_px` on its longest side."""
    with Image.open(picture) as image:
        small = image.convert("RGB")
        small.thumbnail((max_px, max_px))
    buffer = io.BytesIO()
    small.save(buffer, "JPEG", quality=85)
    return buffer.getvalue()
