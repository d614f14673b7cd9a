"""The map that people look at: points from above in their own colours, cameras and where they look."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from aug3d_core.geometry.transforms import centres, forward
from aug3d_core.geometry.views import Points, Views

_MOST_POINTS = 100_000


def draw_map(views: Views, points: Points, unit: str, path: Path) -> None:
    """Write the map as PNG."""
    figure = Figure(figsize=(9, 8), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    shown = points.xyz[:: max(1, len(points.xyz) // _MOST_POINTS)]
    colours = points.rgb[:: max(1, len(points.xyz) // _MOST_POINTS)] / 255
    low, high = np.percentile(points.xyz[:, :2], [0.5, 99.5], axis=0)
    axes.scatter(shown[:, 0], shown[:, 1], s=np.clip(3e4 / len(shown), 1, 12), c=colours, linewidths=0)
    at, ahead = centres(views.cam_from_world), forward(views.cam_from_world)
    axes.plot(at[:, 0], at[:, 1], "-", color="tab:red", lw=0.5, alpha=0.6)
    axes.quiver(at[:, 0], at[:, 1], ahead[:, 0], ahead[:, 1], color="tab:red", scale=25, width=0.003)
    axes.scatter(at[:, 0], at[:, 1], s=14, color="tab:red", label=f"{len(views)} cameras, in capture order")
    low, high = np.minimum(low, at[:, :2].min(axis=0)), np.maximum(high, at[:, :2].max(axis=0))
    pad = 0.03 * (high - low).max()
    axes.set(xlim=(low[0] - pad, high[0] + pad), ylim=(low[1] - pad, high[1] + pad), aspect="equal")
    axes.set(xlabel=f"east [{unit}]", ylabel=f"north [{unit}]", title=f"{len(points.xyz)} points from above")
    axes.legend(loc="upper right")
    figure.savefig(path, dpi=100, metadata={"Software": None})
