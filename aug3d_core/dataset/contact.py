"""The contact sheet: one row of views for each of a few groups, real groups first."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from aug3d_core.dataset.scene import Scene

ROWS, COLUMNS, GAP_PX = 4, 8, 2
MOST_PX = 30e6  # of a sheet: Pillow refuses to read six times as many


def save_contact_sheet(scene: Scene, path: Path) -> None:
    """Draw up to ROWS real, ROWS rendered and ROWS test groups, spread evenly over those there are.

    Views are shrunk where the sheet would have more than MOST_PX.
    """
    rows = [members[:COLUMNS] for name in ("real", "rendered", "test") for members in _spread(scene.groups[name])]
    size_px = fitting((scene.width_px, scene.height_px), (GAP_PX, GAP_PX), len(rows) * COLUMNS)
    width, height = size_px[0] + GAP_PX, size_px[1] + GAP_PX
    sheet = np.full((len(rows) * height, COLUMNS * width, 3), 255, np.uint8)
    for r, members in enumerate(rows):
        for c, view in enumerate(members):
            small = Image.fromarray(_on_grey(scene, view)).resize(size_px, Image.Resampling.BOX)
            sheet[r * height : (r + 1) * height - GAP_PX, c * width : (c + 1) * width - GAP_PX] = small
    Image.fromarray(sheet).save(path)


def fitting(size_px: tuple[int, int], beside_px: tuple[int, int], count: int) -> tuple[int, int]:
    """Return the width and height of so many pictures, shrunk where a sheet of them would have more than MOST_PX.

    beside_px: what each has beside and below itself, which is not shrunk.
    """
    (width, height), (beside, below) = size_px, beside_px
    share = min(1.0, _root(width * height, width * below + height * beside, beside * below - MOST_PX / count))
    return max(1, int(share * width)), max(1, int(share * height))


def _root(a: float, b: float, c: float) -> float:
    return ((b * b - 4 * a * c) ** 0.5 - b) / (2 * a)


def _spread(groups: np.ndarray) -> np.ndarray:
    if not len(groups):
        return groups
    return groups[np.unique(np.linspace(0, len(groups) - 1, ROWS).astype(int))]


def _on_grey(scene: Scene, view: int) -> np.ndarray:
    cover = scene.alpha[view][..., None] / 255
    return (scene.images[view] * cover + 128 * (1 - cover)).astype(np.uint8)
