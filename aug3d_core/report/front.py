"""Time against accuracy: one panel per setting, a dot per value, the front as a step line, failures on the floor. As PNG."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

Mark = Literal["", "preset", "auto", "chosen"]
COLOURS: dict[Mark, str] = {"": "#1d4ed8", "preset": "#c2410c", "auto": "#7e22ce", "chosen": "#15803d"}
FRONT, FLOOR = "#94a3b8", "#dc2626"
_SHAPES: dict[Mark, str] = {"": "o", "preset": "o", "auto": "^", "chosen": "*"}
_COLUMNS = 3
_MOST_TICKS = 6
_NARROW, _BESIDE = 8.0, 1.05  # the last of an axis's values over the first; what an axis has of room, the same way
_LABEL_WIDE, _LABEL_HIGH = 0.35, 0.1  # of the panel: labels nearer than this would cover each other
_NUMBER_WIDE = 0.03
_MOST_NAMED, _KEY_WIDE = 20, 75
_TITLE_WIDE = 53  # characters above a column
_ROOM, _LEAST_ROOM = 0.2, 0.02  # beyond the highest and the lowest dot
_AHEAD, _LEAST_S = 1.3, 1e-3


@dataclass(frozen=True)
class Dot:
    """One value of a setting, or one configuration.

    seconds, accuracy: medians over the repeats; accuracy is None where all failed. repeats: (seconds, accuracy) of each.
    interval: of the accuracy. off: it was judged by another test, and beats nobody. hover: what a pointer is told.
    """

    label: str
    seconds: float
    accuracy: float | None
    repeats: tuple[tuple[float, float], ...] = ()
    interval: tuple[float, float] | None = None
    mark: Mark = ""
    off: bool = False
    hover: str = ""


@dataclass(frozen=True)
class Panel:
    """What is charted together.

    labelled: whether each dot has its label beside it; else dots have numbers, and a key tells them.
    """

    title: str
    accuracy_name: str
    lower_is_better: bool
    dots: tuple[Dot, ...]
    labelled: bool = True

    @property
    def done(self) -> list[Dot]:
        """The dots that have a figure."""
        return [dot for dot in self.dots if dot.accuracy is not None]

    @property
    def on_front(self) -> list[Dot]:
        """The dots that no other beats in both, fastest first."""
        able = [dot for dot in self.done if not dot.off]
        sign = -1 if self.lower_is_better else 1
        return [able[i] for i in front([d.seconds for d in able], [sign * (d.accuracy or 0.0) for d in able])]

    @property
    def named(self) -> list[Dot]:
        """The dots that the chart tells by name, fastest first: where there are many, the front and what is marked."""
        all_of_them, front = self.labelled or len(self.done) <= _MOST_NAMED, self.on_front
        return sorted((d for d in self.done if all_of_them or d.mark or d in front), key=lambda d: d.seconds)

    @property
    def labels(self) -> list[tuple[Dot, list[str]]]:
        """What is written where: names or numbers, those of dots that lie close together at one of them."""
        named = self.named
        texts = [dot.label if self.labelled else str(number) for number, dot in enumerate(named, start=1)]
        accuracy = np.array([dot.accuracy or 0.0 for dot in named])
        x = np.log(np.maximum([dot.seconds for dot in named], _LEAST_S))
        together = near(x, np.log(accuracy) if self.log_y else accuracy, _LABEL_WIDE if self.labelled else _NUMBER_WIDE)
        return [(named[group[0]], [texts[i] for i in group]) for group in together]

    @property
    def heights(self) -> list[float]:
        """What the axis of accuracy has to hold: dots and repeats; an interval may reach beyond."""
        return [value for dot in self.done for value in (dot.accuracy or 0.0, *(y for _, y in dot.repeats))]

    @property
    def fastest_s(self) -> float:
        """Where what failed before it took any time is drawn."""
        return max(min((dot.seconds for dot in self.done), default=1.0) / _AHEAD, _LEAST_S)

    @property
    def span_s(self) -> list[float]:
        """The times that the axis has to hold."""
        return [max(dot.seconds, self.fastest_s) for dot in self.dots]

    @property
    def log_y(self) -> bool:
        """Whether the accuracy is drawn on a log axis: errors span decades."""
        return self.lower_is_better and bool(self.done) and min(self.heights) > 0

    @property
    def axis_name(self) -> str:
        """The name of the accuracy, and which way is better where that is down."""
        return self.accuracy_name + (" - up is better: less error" if self.lower_is_better else "")


def front(seconds: Sequence[float], gain: Sequence[float]) -> list[int]:
    """Return the indices of the points that no other beats in both, by time."""
    best, chosen = -np.inf, []
    for index in sorted(range(len(seconds)), key=lambda i: (seconds[i], -gain[i])):
        if gain[index] > best:
            best = gain[index]
            chosen.append(index)
    return chosen


def near(x: ArrayLike, y: ArrayLike, wide: float) -> list[list[int]]:
    """Return the points in groups that lie too close together on a panel for a label each."""
    at = np.column_stack([x, y]).astype(float)
    at = (at - at.min(axis=0, initial=np.inf)) / np.maximum(np.ptp(at, axis=0) if len(at) else 1.0, 1e-9)
    groups: list[list[int]] = []
    for index in np.lexsort(at.T):
        close = (
            g for g in groups if abs(at[g[0]] - at[index])[0] < wide and abs(at[g[0]] - at[index])[1] < _LABEL_HIGH
        )
        group = next(close, None)
        if group is None:
            groups.append([int(index)])
        else:
            group.append(int(index))
    return groups


def ticks(values: Sequence[float]) -> list[float]:
    """Return round numbers about and among positive values for a logarithmic axis, few enough to be read."""
    low, high = min(values), max(values)
    if high < _NARROW * low:
        low, high = low / _BESIDE, high * _BESIDE
        found = MaxNLocator(_MOST_TICKS - 2, steps=[1, 2, 5, 10]).tick_values(low, high)
        return [tick for tick in found if low <= tick <= high]
    for steps in ((1, 3), (1, 2, 5)):
        decades = 10.0 ** np.arange(np.floor(np.log10(low)) - 1, np.ceil(np.log10(high)) + 2)
        series = np.sort(np.outer(decades, steps).ravel())
        first, last = np.searchsorted(series, low, "right") - 1, np.searchsorted(series, high)
        if last - first > 3:  # three of them among the values
            break
    found = series[max(first, 0) : last + 1]
    return found[:: -(-len(found) // _MOST_TICKS)].tolist()


def draw(panels: Sequence[Panel], title: str, path: Path) -> None:
    """Write the chart as PNG: panels in columns, but one that is alone, or has a key, as wide as all."""
    wide = [panel for panel in panels if not panel.labelled or len(panels) == 1]
    small = [panel for panel in panels if panel not in wide]
    columns = _COLUMNS if wide else min(len(small), _COLUMNS)
    rows = -(-len(small) // columns)
    figure = Figure(figsize=(5.2 * columns, 5.6 * len(wide) + 3.9 * rows + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    lines = (fill(line, _TITLE_WIDE * columns) for line in title.splitlines())
    figure.suptitle("\n".join(lines), fontsize=11)
    heights = [5.6] * len(wide) + [3.9] * rows
    grid = figure.add_gridspec(len(heights), columns, height_ratios=heights)
    for row, panel in enumerate(wide):
        _panel(figure.add_subplot(grid[row, :] if panel.labelled else grid[row, :-1]), panel)
        if not panel.labelled:
            _key(figure.add_subplot(grid[row, -1]), panel)
    for index, panel in enumerate(small):
        _panel(figure.add_subplot(grid[len(wide) + index // columns, index % columns]), panel)
    figure.savefig(path, dpi=110, metadata={"Software": None})


def _panel(axes: Axes, panel: Panel) -> None:
    axes.set(title=panel.title, xlabel="processor seconds", xscale="log")
    axes.set_ylabel(panel.axis_name, size=8)
    _heights(axes, panel)
    best = panel.on_front
    axes.step([d.seconds for d in best], [d.accuracy or 0.0 for d in best], where="post", color=FRONT, zorder=1)
    for dot in panel.done:
        _dot(axes, dot)
    _labels(axes, panel)
    _floor(axes, panel)
    axes.set_xticks(ticks(panel.span_s))
    axes.xaxis.set_major_formatter("{x:g}")
    if panel.log_y:
        axes.set_yticks(ticks([dot.accuracy or 0.0 for dot in panel.done]))
        axes.yaxis.set_major_formatter("{x:g}")
    axes.minorticks_off()
    axes.grid(True, alpha=0.2)
    axes.margins(x=0.25 if panel.labelled else 0.05)


def _heights(axes: Axes, panel: Panel) -> None:
    """Set the axis of accuracy, better up: intervals are cut off, for they may be many times as long as dots are apart."""
    if panel.log_y:
        axes.set_yscale("log")
    if panel.done:
        shown = np.log10(panel.heights) if panel.log_y else np.asarray(panel.heights)
        room = max(_ROOM * float(np.ptp(shown)), _LEAST_ROOM)
        ends = np.array([shown.min() - room, shown.max() + room])
        axes.set_ylim(*(10.0**ends if panel.log_y else ends))
    if panel.lower_is_better:
        axes.invert_yaxis()


def _dot(axes: Axes, dot: Dot) -> None:
    colour, y = COLOURS[dot.mark], dot.accuracy or 0.0
    if dot.interval:
        axes.vlines(dot.seconds, *dot.interval, color=colour, alpha=0.4, lw=1, zorder=1)
    if len(dot.repeats) > 1:
        axes.scatter(*zip(*dot.repeats, strict=True), s=12, color=colour, alpha=0.5, zorder=2)
    size = 150 if dot.mark == "chosen" else 70 if dot.mark == "auto" else 46
    face = "none" if dot.off else colour
    axes.scatter(dot.seconds, y, s=size, marker=_SHAPES[dot.mark], facecolor=face, edgecolor=colour, zorder=3)


def _labels(axes: Axes, panel: Panel) -> None:
    """Write names beside dots, or numbers."""
    for dot, texts in panel.labels:
        said, at = ("\n" if panel.labelled else ", ").join(texts), (dot.seconds, dot.accuracy or 0.0)
        axes.annotate(said, at, (5, 5), textcoords="offset points", size=7)


def _key(axes: Axes, panel: Panel) -> None:
    """Write what the numbers stand for."""
    told = [f"{dot.label}: {dot.accuracy:#.4g} in {dot.seconds:,.0f} s" for dot in panel.named]
    lines = [fill(f"{i}  {text}", _KEY_WIDE, subsequent_indent="    ") for i, text in enumerate(told, start=1)]
    axes.axis("off")
    axes.text(0.02, 0.5, "\n".join(lines), size=7, va="center", linespacing=1.4, in_layout=False)


def _floor(axes: Axes, panel: Panel) -> None:
    """Mark what failed below everything else."""
    floor = axes.get_ylim()[0]
    for dot in panel.dots:
        if dot.accuracy is None:
            at = max(dot.seconds, panel.fastest_s), floor
            axes.scatter(*at, marker="x", color=FLOOR, clip_on=False, zorder=3)
            axes.annotate(f"{dot.label} failed", at, (5, 5), textcoords="offset points", size=7)
