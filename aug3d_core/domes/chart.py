"""The map of domes and cameras over the surface seen from above, and the chart of what they reach."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from aug3d_core.domes.cameras import Plan
from aug3d_core.domes.choice import NEARLY, Choice
from aug3d_core.domes.height_raster import HeightRaster


def draw_map(plan: Plan, ground: HeightRaster, path: Path) -> None:
    """Write a PNG: domes with their squares, cameras with the way they look, and places passed over."""
    figure = Figure(figsize=(8, 8), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    west, south = ground.low
    east, north = ground.low + ground.extent
    image = np.dstack([ground.rgb, np.where(ground.covered, 255, 0).astype(np.uint8)])
    axes.imshow(image, origin="lower", extent=(west, east, south, north), alpha=0.75)
    empty = np.array([(dome.x, dome.y) for dome in plan.domes if not dome.views]).reshape(-1, 2)
    axes.plot(*empty.T, "x", ms=4, color="0.3", mew=0.8)
    _draw_cameras(axes, plan)
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_xlabel("x (world units)")
    axes.set_ylabel("y (world units)")
    used = sum(dome.views > 0 for dome in plan.domes)
    axes.set_title(f"{used} domes, {len(plan.cameras)} cameras; crosses: places passed over")
    figure.savefig(path, dpi=110, metadata={"Software": None})


def draw_coverage(kept: Choice, uniform: Choice, path: Path) -> None:
    """Write a PNG: what is reached after so many views, chosen and uniformly drawn."""
    figure = Figure(figsize=(8, 5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    choices = [(uniform, "#1d4ed8", "uniform")]
    if kept is not uniform:
        choices.append((kept, "#c2410c", "chosen by coverage"))
    for choice, colour, name in choices:
        views, count = np.arange(len(choice.curve.sights)), len(choice.plan.cameras)
        axes.plot(views, 100 * choice.curve.sights, color=colour, label=f"surface from directions, {name}")
        axes.plot(views, 100 * choice.curve.points, color=colour, ls=":", label=f"surface from any direction, {name}")
        axes.plot(count, 100 * choice.curve.sights[count], "o", color=colour)
    start, end = 100 * uniform.curve.sights[[0, -1]]
    axes.axhline(start + NEARLY * (end - start), color="0.6", lw=0.8)
    axes.annotate("95 % of what uniform adds", (0, start + NEARLY * (end - start)), color="0.4", va="bottom")
    axes.set(xlabel="virtual views", ylabel="reached (%)", ylim=(0, 100), xlim=(0, None))
    axes.set_title("What photos and virtual views show; dots: views kept")
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right")
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
        corner = (dome.x - dome.cell / 2, dome.y - dome.cell / 2)
        axes.add_patch(Rectangle(corner, dome.cell, dome.cell, fill=False, lw=1.2, ec=colour))
        axes.plot(*places[mine, :2].T, "o", ms=3.5, color=colour, mec="white", mew=0.4)
        arrow = 0.12 * dome.radius * looks[mine, :2]
        axes.quiver(*places[mine, :2].T, *arrow.T, color=colour, angles="xy", scale_units="xy", scale=1, width=0.003)
