"""A table as a picture: every arm's PSNR with its range and seeds, and the difference to the arm it is compared with."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from aug3d_core.studies.paper.findings import PaperFindings
from aug3d_core.studies.paper.rows import ArmRow

_MEAN, _SEED, _RANGE, _BAD, _GOOD, _CHEAP = "#1d4ed8", "#60a5fa", "#cbd5e1", "#dc2626", "#15803d", "#a16207"
_ROW_IN, _HEAD_IN, _PART_IN = 0.34, 1.1, 0.95  # inches
_LINE_PT = 10.0  # names of neighbours are on different lines


def draw(found: PaperFindings, path: Path) -> None:
    """Write the chart as PNG."""
    parts = found.parts
    heights = [_ROW_IN * len(rows) + _PART_IN for rows in parts.values()]
    figure = Figure(figsize=(13, sum(heights) + _HEAD_IN), layout="constrained")
    FigureCanvasAgg(figure)
    effort = ", ".join(
        f"{value} {name}" if isinstance(value, int) else f"{name} {value}" for name, value in found.effort.items()
    )
    figure.suptitle(
        f"{found.table.question}\n{found.scene}: {found.test_photos} test photographs, {found.seeds} seeds, {effort}\n"
        "bar: lowest to best photograph, dots: mean of each seed, diamond: average",
        fontsize=11,
    )
    panels = np.asarray(
        figure.subplots(len(parts), 2, squeeze=False, sharex="col", height_ratios=heights, width_ratios=(3, 2))
    )
    for (left, right), part, rows in zip(panels, parts, parts.values(), strict=True):
        _scores(left, part, rows, found)
        _differences(right, rows)
    figure.savefig(path, dpi=110, metadata={"Software": None})


def _scores(axes: Axes, part: str, rows: Sequence[ArmRow], found: PaperFindings) -> None:
    for y, row in enumerate(rows):
        if row.average is None or row.low is None or row.best is None:
            axes.annotate(
                f"no score; {row.notes[0] if row.notes else ''}"[:110], (0.01, y), xycoords=("axes fraction", "data"),
                va="center", size=8, color=_BAD,
            )  # fmt: skip
            continue
        axes.plot([row.low, row.best], [y, y], color=_RANGE, lw=6, solid_capstyle="round", zorder=1)
        axes.scatter(row.seeds, [y] * len(row.seeds), s=22, color=_SEED, zorder=2)
        axes.scatter(row.average, y, s=70, marker="D", color=_MEAN, zorder=3)
        if row.failed:
            axes.annotate(
                f"{row.failed} of {row.runs} runs failed", (row.best, y), (8, 0), textcoords="offset points",
                va="center", size=8, color=_BAD,
            )  # fmt: skip
    _cheap(axes, rows, found)
    axes.set_yticks(range(len(rows)), [row.name for row in rows])
    axes.set(title=f"{part}: PSNR (dB)")
    _dress(axes, len(rows))


def _cheap(axes: Axes, rows: Sequence[ArmRow], found: PaperFindings) -> None:
    """Mark the PSNR of cheap answers on the same test if it is near that of the arms."""
    known = [value for row in rows for value in (row.low, row.best) if value is not None]
    cheap = found.cheap.get(min(found.cheap, default=0), {})
    near = [name for name in cheap if known and min(known) - 1 <= cheap[name] <= max(known) + 1]
    for place, name in enumerate(sorted(near, key=lambda name: cheap[name])):
        axes.axvline(cheap[name], color=_CHEAP, lw=1, ls="--", zorder=0)
        axes.annotate(
            name.replace("_", " "), (cheap[name], 0), (3, 2 + _LINE_PT * (place % 2)), xycoords=("data", "axes fraction"),
            textcoords="offset points", size=8, color=_CHEAP,
        )  # fmt: skip


def _differences(axes: Axes, rows: Sequence[ArmRow]) -> None:
    axes.axvline(0, color="#334155", lw=1)
    for y, row in enumerate(rows):
        if row.against is None:
            axes.scatter(0, y, s=50, marker="D", facecolor="white", edgecolor=_MEAN, zorder=2)
        elif row.against.mean is not None:
            colour = {"holds": _GOOD, "does not hold": _BAD, "not decided": "#64748b"}[row.against.verdict]
            if row.against.interval is not None:
                axes.plot(row.against.interval, [y, y], color=colour, lw=2)
            axes.scatter(row.against.mean, y, s=40, color=colour, zorder=2)
    axes.set_yticks(range(len(rows)), [""] * len(rows))
    axes.set(title="Difference to the arm at zero (dB), 95 % interval")
    _dress(axes, len(rows))


def _dress(axes: Axes, rows: int) -> None:
    axes.title.set_fontsize(9)
    axes.set_ylim(rows - 0.1, -0.5)  # names of cheap answers are below the last row
    axes.grid(True, axis="x", alpha=0.25)
    axes.tick_params(labelbottom=True)
    axes.margins(x=0.08)
