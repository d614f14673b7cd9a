"""The map of domes and cameras over the surface seen from above."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from aug3d_core.sampling.cameras import Plan
from aug3d_core.sampling.ground import Ground


def draw_map(plan: Plan, ground: Ground, path: Path) -> None:
    """Write a PNG: cells (grey where passed over), dome centres, and cameras with the way they look."""
    figure = Figure(figsize=(8, 8), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    west, south = ground.low
    east, north = ground.low + ground.extent
    image = np.dstack([ground.rgb, np.where(ground.covered, 255, 0).astype(np.uint8)])
    axes.imshow(image, origin="lower", extent=(west, east, south, north), alpha=0.75)
    for dome in plan.domes:
        corner = (dome.x - dome.cell / 2, dome.y - dome.cell / 2)
        used = dome.views > 0
        axes.add_patch(
            Rectangle(
                corner, dome.cell, dome.cell, fill=False, lw=1.2 if used else 0.6, ls="-" if used else ":", ec="0.25"
            )
        )
    _draw_cameras(axes, plan)
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_xlabel("x (world units)")
    axes.set_ylabel("y (world units)")
    used = sum(dome.views > 0 for dome in plan.domes)
    axes.set_title(f"{used} domes, {len(plan.cameras)} cameras; dotted cells are passed over")
    figure.savefig(path, dpi=110, metadata={"Software": None})


def _draw_cameras(axes, plan: Plan) -> None:
    places = plan.cameras.world_from_cam[:, :3, 3]
    looks = plan.cameras.world_from_cam[:, :3, 2]
    used = [dome for dome in plan.domes if dome.views > 0]
    palette = colormaps["tab20"]
    for index, dome in enumerate(used):
        mine = plan.cameras.dome_id == index
        colour = palette(index % 20)
        axes.plot(dome.x, dome.y, "o", ms=7, mfc=colour, mec="black")
        axes.plot(*places[mine, :2].T, "o", ms=3.5, color=colour, mec="white", mew=0.4)
        arrow = 0.12 * dome.radius * looks[mine, :2]
        axes.quiver(*places[mine, :2].T, *arrow.T, color=colour, angles="xy", scale_units="xy", scale=1, width=0.003)
