"""A contact sheet: many small pictures as one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from PIL import Image

_GAP = 2
_WIDEST_PX = 512  # eight side by side are as many as anybody looks at


def contact_sheet(images: Sequence[UInt8[np.ndarray, "h w 3"]], columns: int = 8) -> UInt8[np.ndarray, "sh sw 3"]:
    """Lay equally large pictures out in rows, on white."""
    columns = min(columns, len(images))
    rows = -(-len(images) // columns)
    height, width = images[0].shape[0] + _GAP, images[0].shape[1] + _GAP
    sheet = np.full((rows * height - _GAP, columns * width - _GAP, 3), 255, np.uint8)
    for i, image in enumerate(images):
        y, x = i // columns * height, i % columns * width
        sheet[y : y + height - _GAP, x : x + width - _GAP] = image
    return sheet


def save_sheet(images: Sequence[UInt8[np.ndarray, "h w 3"]], path: Path) -> None:
    """Write a contact sheet as PNG; none if there are no pictures."""
    if images:
        smaller = -(-images[0].shape[1] // _WIDEST_PX)
        Image.fromarray(contact_sheet([np.asarray(Image.fromarray(one).reduce(smaller)) for one in images])).save(path)
