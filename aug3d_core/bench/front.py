"""Time against accuracy: one panel per setting, one point per value, as a table and as a chart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

_COLUMNS = 3
_DEFAULT, _OTHER, _FRONT, _FLOOR = "#c2410c", "#1d4ed8", "#94a3b8", "#dc2626"


@dataclass(frozen=True)
class Point:
    """One value of one setting. accuracy is None where the factory refused or failed; `failure` then says why."""

    setting: str
    value: str
    default: bool
    seconds: float
    peak_mib: float
    accuracy: float | None
    accuracy_name: str
    failure: str = ""


def table(points: Sequence[Point]) -> pd.DataFrame:
    """Return one row per point."""
    return pd.DataFrame([vars(point) for point in points])


def front(seconds: Sequence[float], gain: Sequence[float]) -> list[int]:
    """Return the indices of the points that no other beats in both, by time."""
    best, chosen = -np.inf, []
    for index in sorted(range(len(seconds)), key=lambda i: (seconds[i], -gain[i])):
        if gain[index] > best:
            best = gain[index]
            chosen.append(index)
    return chosen


def draw(points: Sequence[Point], lower_is_better: frozenset[str], title: str, path: Path) -> None:
    """Write the chart as PNG: the default in orange, the Pareto front as a step line, failures on the floor."""
    settings = list(dict.fromkeys(point.setting for point in points))
    rows = -(-len(settings) // _COLUMNS)
    figure = Figure(figsize=(5.2 * _COLUMNS, 3.9 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=11)
    for index, setting in enumerate(settings):
        axes = figure.add_subplot(rows, _COLUMNS, index + 1)
        chosen = [point for point in points if point.setting == setting]
        _panel(axes, chosen, chosen[0].accuracy_name in lower_is_better)
    figure.savefig(path, dpi=110, metadata={"Software": None})


def _panel(axes: Axes, points: Sequence[Point], lower_is_better: bool) -> None:
    axes.set(title=points[0].setting, xlabel="seconds", xscale="log", ylabel=_axis_name(points[0], lower_is_better))
    if lower_is_better:
        axes.set_yscale("log")
        axes.invert_yaxis()
    done = [point for point in points if point.accuracy is not None]
    seconds, accuracy = [p.seconds for p in done], [float(p.accuracy or 0.0) for p in done]
    gain = [-a for a in accuracy] if lower_is_better else accuracy
    on_front = front(seconds, gain)
    axes.step([seconds[i] for i in on_front], [accuracy[i] for i in on_front], where="post", color=_FRONT, zorder=1)
    for point, x, y in zip(done, seconds, accuracy, strict=True):
        axes.scatter(x, y, s=46, color=_DEFAULT if point.default else _OTHER, zorder=2)
        axes.annotate(f"{point.value}  ({point.peak_mib:,.0f} MiB)", (x, y), (5, 5), textcoords="offset points", size=7)
    for point in points:
        if point.accuracy is None:
            floor = axes.get_ylim()[0]
            axes.scatter(max(point.seconds, 1e-3), floor, marker="x", color=_FLOOR, clip_on=False, zorder=3)
            axes.annotate(
                f"{point.value} failed", (max(point.seconds, 1e-3), floor), (5, 5), textcoords="offset points"
            )
    axes.grid(True, which="both", alpha=0.2)
    axes.margins(x=0.25, y=0.2)


def _axis_name(point: Point, lower_is_better: bool) -> str:
    return point.accuracy_name.replace("_", " ") + (" (up is better: less error)" if lower_is_better else "")
