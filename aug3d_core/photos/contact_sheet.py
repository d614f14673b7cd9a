"""A contact sheet: the photographs side by side, in capture order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

_MOST = 60
_CELL = (192, 144)


def contact_sheet(files: Sequence[Path], path: Path) -> None:
    """Write a sheet of at most 60 photographs, evenly spread over the capture."""
    chosen = np.unique(np.linspace(0, len(files) - 1, min(len(files), _MOST)).round().astype(int))
    columns = min(10, math.ceil(math.sqrt(len(chosen) * 1.6)))
    sheet = Image.new("RGB", (columns * _CELL[0], math.ceil(len(chosen) / columns) * _CELL[1]), "white")
    for cell, index in enumerate(chosen):
        with Image.open(files[index]) as photo:
            photo.thumbnail((_CELL[0] - 4, _CELL[1] - 4))
            sheet.paste(photo, ((cell % columns) * _CELL[0] + 2, (cell // columns) * _CELL[1] + 2))
    sheet.save(path, quality=85)
