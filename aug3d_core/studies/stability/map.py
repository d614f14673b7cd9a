"""The stability map: a row per method, a column per dose, coloured by the distance from the mark.

Blue is better than the mark, red is broken. The frame shows what the factory reported.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from aug3d_core.studies.stability.findings import Dose, MethodRow, StabilityFindings
from aug3d_core.studies.stability.perturbation import Judge

_ROW_IN, _TITLE_IN, _FOOT_IN, _HEAD_IN, _CELL_IN, _LABEL_IN = 0.28, 0.34, 0.26, 0.9, 0.8, 2.4
_COLUMNS, _FEW_ROWS = 3, 30  # a map of few rows is one column
_LEAST_DOSES = 6  # wide enough for titles
_SILENT, _CRASH, _REFUSED, _DEGRADED = "#c026d3", "#000000", "#7f1d1d", "#d97706"
_FRAMES = {"degraded": _DEGRADED, "refused": _REFUSED, "crash": _CRASH}
_COLOURS = colormaps["RdBu"]
_STRONG = 0.6  # of the colour scale: the ends are too dark to write on


def margin(judge: Judge, accuracy: float | None) -> float:
    """Return how far a figure is on the good side of the mark: 1 at twice as good or better, -1 at half as good or none.

    For a mark of zero or less it is the difference.
    """
    if accuracy is None or math.isnan(accuracy):
        return -1.0
    if judge.mark > 0 >= accuracy:
        return -1.0 if judge.better == "higher" else 1.0
    if judge.mark <= 0:
        good = accuracy - judge.mark if judge.better == "higher" else judge.mark - accuracy
        return max(-1.0, min(1.0, good)) or (0.0 if judge.broken(accuracy) else 0.5)
    ratio = accuracy / judge.mark if judge.better == "higher" else judge.mark / accuracy
    return math.log2(max(0.5, min(2.0, ratio)))


def draw(found: StabilityFindings, path: Path) -> None:
    """Write the map as PNG: the perturbations in columns, in the order of the factory."""
    blocks = _blocks(found.rows)
    columns = _balanced(blocks)
    most = max(_LEAST_DOSES, *(len(row.doses) for row in found.rows))
    width = _LABEL_IN + _CELL_IN * most + _FOOT_IN
    height = _HEAD_IN + max(sum(map(_block_in, column)) for column in columns)
    figure = Figure(figsize=(width * len(columns), height))
    FigureCanvasAgg(figure)
    for number, column in enumerate(columns):
        top = height - _HEAD_IN
        for block in column:
            high, wide = _ROW_IN * len(block), _CELL_IN * len(block[0].doses)
            left, bottom = width * number + _LABEL_IN, top - _TITLE_IN - high
            axes = figure.add_axes(
                (left / figure.get_figwidth(), bottom / height, wide / figure.get_figwidth(), high / height)
            )
            _panel(axes, block)
            top -= _block_in(block)
    figure.text(0.01, 1 - 0.1 / height, _title(found), size=10, va="top")
    figure.legend(
        handles=_legend(), loc="upper left", bbox_to_anchor=(0, 1 - 0.5 / height), ncols=4, fontsize=8, frameon=False
    )
    figure.savefig(path, dpi=100, metadata={"Software": None})


def _title(found: StabilityFindings) -> str:
    return (
        f"Where methods break: {len(found.results)} cells, {len(found.silent)} silent failures, {len(found.crashes)} crashes\n"
        f"median of {found.seeds} seed{'s' * (found.seeds > 1)}; a number is the judged figure, colour how far it is from"
        " the mark"
    )


def _panel(axes: Axes, rows: Sequence[MethodRow]) -> None:
    perturbation = rows[0].perturbation
    judge = perturbation.judge
    sign = ">=" if judge.better == "higher" else "<="
    axes.set_title(
        f"{perturbation.name}   ({judge.name} {sign} {judge.mark:g})", fontsize=8, loc="left", fontweight="bold"
    )
    axes.set(xlim=(0, len(rows[0].doses)), ylim=(len(rows), 0))
    for y, row in enumerate(rows):
        for x, dose in enumerate(row.doses):
            _cell(axes, x, y, judge, dose)
    axes.set_yticks([y + 0.5 for y in range(len(rows))], [row.method for row in rows], fontsize=8)
    labels = [f"{dose.dose:g}" for dose in rows[0].doses]
    labels[-1] += f" {perturbation.dose_unit}"
    axes.set_xticks([x + 0.5 for x in range(len(labels))], labels, fontsize=8)
    axes.tick_params(length=0, pad=2)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _cell(axes: Axes, x: int, y: int, judge: Judge, dose: Dose) -> None:
    colour = _COLOURS(0.5 + 0.5 * _STRONG * margin(judge, dose.accuracy))
    axes.add_patch(Rectangle((x, y), 1, 1, facecolor=colour, edgecolor="white", lw=1))
    frame = _SILENT if dose.silent else _FRAMES.get(dose.state)
    if frame:
        axes.add_patch(Rectangle((x + 0.04, y + 0.08), 0.92, 0.84, fill=False, edgecolor=frame, lw=2))
    said = {"ok": "nothing"}.get(dose.state, dose.state) if dose.accuracy is None else f"{dose.accuracy:.3g}"
    weight = "bold" if dose.broken else "normal"
    axes.text(x + 0.5, y + 0.53, said, ha="center", va="center", fontsize=8, fontweight=weight)


def _legend() -> list[Patch]:
    frames = {
        "the factory reports degraded": _DEGRADED,
        "refused": _REFUSED,
        "broken, and nothing reported": _SILENT,
        "crash": _CRASH,
    }
    return [Patch(facecolor="none", edgecolor=colour, lw=2, label=name) for name, colour in frames.items()]


def _blocks(rows: Sequence[MethodRow]) -> list[list[MethodRow]]:
    by_name: dict[str, list[MethodRow]] = {}
    for row in rows:
        by_name.setdefault(row.perturbation.name, []).append(row)
    return list(by_name.values())


def _block_in(block: Sequence[MethodRow]) -> float:
    return _ROW_IN * len(block) + _TITLE_IN + _FOOT_IN


def _balanced(blocks: Sequence[list[MethodRow]]) -> list[list[list[MethodRow]]]:
    """Cut the blocks into columns of about the same height."""
    count = _COLUMNS if sum(map(len, blocks)) > _FEW_ROWS else 1
    share, columns = sum(map(_block_in, blocks)) / count, [[]]
    for block in blocks:
        if len(columns) < count and sum(map(_block_in, columns[-1])) + _block_in(block) / 2 > share:
            columns.append([])
        columns[-1].append(block)
    return columns
