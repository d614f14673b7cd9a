"""The picture of the buildings in the surface seen from above."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from aug3d_core.domes.boxes import Buildings

_MASK, _FOUND, _TRUE = "#facc15", "#06b6d4", "#dc2626"


def draw_buildings(found: Buildings, path: Path, true: Float[np.ndarray, "t 4"] | None = None) -> None:
    """Write a PNG: the outline of what is built in yellow, boxes in cyan, the true boxes (where known) in red."""
    figure = Figure(figsize=(8, 8), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    west, south = found.low
    east, north = found.low + found.square * np.array(found.mask.shape[::-1])
    extent = (west, east, south, north)
    image = np.dstack([found.rgb, np.where(found.covered, 255, 0).astype(np.uint8)])
    axes.imshow(image, origin="lower", extent=extent)
    if found.mask.any():
        axes.contour(found.mask, [0.5], origin="lower", extent=extent, colors=_MASK, linewidths=1.0)
    if true is not None:
        _draw(axes, true, _TRUE)
    _draw(axes, found.boxes, _FOUND)
    axes.set(xlabel="x (world units)", ylabel="y (world units)")
    told = f"boxes found (cyan): {len(found.boxes)}"
    axes.set_title(told if true is None else f"{told}; true ones (red): {len(true)}")
    figure.savefig(path, dpi=110, metadata={"Software": None})


def _draw(axes: Axes, boxes: Float[np.ndarray, "b 4"], colour: str) -> None:
    for west, south, east, north in boxes:
        axes.add_patch(Rectangle((west, south), east - west, north - south, fill=False, lw=1.4, ec=colour))
