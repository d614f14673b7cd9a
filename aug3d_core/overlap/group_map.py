"""The map of every way of grouping: cameras coloured by group, over the points from above."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import numpy as np
from jaxtyping import Int
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from aug3d_core.geometry.transforms import centres
from aug3d_core.groups.scene import GroupingScene
from aug3d_core.overlap.pair_overlaps import PairOverlaps, is_bad

_COLUMNS = 3
_MOST_POINTS = 30_000
_RING = 5.5  # growth of a marker from group to group (points): a camera in several groups shows a ring of each


def draw_groups(
    scene: GroupingScene, groups: Mapping[str, Int[np.ndarray, "p k"]], overlaps: PairOverlaps, path: Path | BytesIO
) -> None:
    """Write a PNG with a panel for each way: the cameras of its groups at the sample places, a colour for each place.

    Lines lead to where cameras look, a star the group's centre, a red cross a bad member; other cameras are grey.
    """
    columns = min(_COLUMNS, len(groups))
    rows = -(-len(groups) // columns)
    at = centres(scene.views.cam_from_world)
    extent = _extent(scene, at)
    width, height = extent[1] - extent[0]
    figure = Figure(figsize=(6 * columns, 6 * rows * height / width + 0.6 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    for index, (method, members) in enumerate(groups.items()):
        axes = figure.add_subplot(rows, columns, index + 1)
        _panel(axes, scene, members, overlaps)
        axes.set(xlim=extent[:, 0], ylim=extent[:, 1], aspect="equal", xticks=[], yticks=[])
        bad = sum(int(is_bad(_overlap(group, overlaps)).sum()) for group in members)
        axes.set_title(f"{method}: {bad} of {members[:, 1:].size} members shown are bad")
    figure.savefig(path, dpi=80, metadata={"Software": None})


def _panel(axes: Axes, scene: GroupingScene, members: Int[np.ndarray, "p k"], overlaps: PairOverlaps) -> None:
    points = scene.points_in_world[:: max(1, len(scene.points_in_world) // _MOST_POINTS)]
    axes.scatter(points[:, 0], points[:, 1], s=2, color="0.8", linewidths=0)
    at = centres(scene.views.cam_from_world)[:, :2]
    axes.scatter(*at.T, s=10, color="grey")
    times = np.zeros(len(at), int)
    for group in members:
        times[group] += 1
    drawn = np.zeros(len(at), int)
    for number, group in enumerate(members):
        size = (6 + _RING * (times[group] - drawn[group] - 1)) ** 2  # the first group's ring is the outermost
        drawn[group] += 1
        axes.scatter(*at[group].T, s=size, color=f"C{number}", linewidths=0, zorder=3 + number)
    for number, group in enumerate(members):
        lines = np.stack([at[group], scene.look_in_world[group]]).transpose(2, 0, 1)
        axes.plot(*lines, color=f"C{number}", lw=0.8, alpha=0.7, zorder=2)
        axes.scatter(*at[group[0]], s=130, marker="*", color=f"C{number}", edgecolors="black", zorder=40)
        bad = group[1:][is_bad(_overlap(group, overlaps))]
        axes.scatter(*at[bad].T, s=40, marker="x", color="red", zorder=50)


def _overlap(group: Int[np.ndarray, " k"], overlaps: PairOverlaps) -> np.ndarray:
    return overlaps.of(np.full(len(group) - 1, group[0]), group[1:])


def _extent(scene: GroupingScene, at: np.ndarray) -> np.ndarray:
    """Return the corners (2 x 2) of what is drawn: the cameras, and where they look."""
    corners = np.vstack([at[:, :2], scene.look_in_world])
    pad = 0.04 * np.ptp(corners, axis=0).max()
    return np.stack([corners.min(axis=0) - pad, corners.max(axis=0) + pad])
