"""The same chart for a browser: a pointer is told every figure, and a part can be drawn larger. It needs no network."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from aug3d_core.report.front import COLOURS, FLOOR, FRONT, Dot, Mark, Panel, ticks
from aug3d_core.report.html import duration, table, tag

_SHAPES: dict[Mark, str] = {"": "circle", "preset": "circle", "auto": "triangle-up", "chosen": "star"}
_CALLED: dict[Mark, str] = {"": "tried", "preset": "as the scene has it", "auto": "auto", "chosen": "chosen"}
_FLOOR_SHARE = 0.08  # of the height: how far below everything else failures lie
_ROOM, _LEAST_ROOM = 0.08, 0.02
_LABEL_ROOM = 0.35  # right of the last dot


def script() -> str:
    """Return what all charts of a page need once."""
    return f"<script>{get_plotlyjs()}</script>"


def panel_html(panel: Panel) -> str:
    """Return a panel as a piece of HTML; the page needs `script` before it."""
    figure = go.Figure(layout=_layout(panel))
    best = panel.on_front
    figure.add_scatter(
        x=[dot.seconds for dot in best], y=[dot.accuracy for dot in best], mode="lines", line_shape="hv",
        line_color=FRONT, name="front", hoverinfo="skip",
    )  # fmt: skip
    repeats = [one for dot in panel.done if len(dot.repeats) > 1 for one in dot.repeats]
    if repeats:
        figure.add_scatter(
            x=[x for x, _ in repeats], y=[y for _, y in repeats], mode="markers", name="each seed", hoverinfo="skip",
            marker={"size": 5, "color": FRONT},
        )  # fmt: skip
    for mark in _CALLED:
        for off in (False, True):
            _dots(figure, mark, [dot for dot in panel.done if dot.mark == mark and dot.off == off], off)
    _failures(figure, panel)
    _labels(figure, panel)
    chart = figure.to_html(full_html=False, include_plotlyjs=False, config={"displaylogo": False, "responsive": True})
    return chart if panel.labelled else chart + _key(panel)


def _labels(figure: go.Figure, panel: Panel) -> None:
    for dot, texts in panel.labels:
        y = dot.accuracy or 0.0
        figure.add_annotation(
            x=np.log10(dot.seconds), y=np.log10(y) if panel.log_y else y, xshift=4, yshift=3, showarrow=False,
            text=("<br>" if panel.labelled else ", ").join(map(escape, texts)), font={"size": 10}, align="left",
            xanchor="left", yanchor="bottom",
        )  # fmt: skip


def _key(panel: Panel) -> str:
    """Return the table of what the numbers stand for."""
    best = panel.on_front
    rows = [
        (
            str(number),
            tag("span", escape(dot.label), style="white-space:normal"),
            "-" if dot.accuracy is None else f"{dot.accuracy:#.4g}",
            duration(dot.seconds),
            str(max(len(dot.repeats), 1)),
            "nothing" if dot in best else "",
        )
        for number, dot in enumerate(panel.named, start=1)
    ]
    heads = ("", "", escape(panel.accuracy_name), "processor time", "seeds", "is faster and as good")
    return table(heads, rows, numeric=(0, 2, 3, 4))


def _layout(panel: Panel) -> go.Layout:
    return go.Layout(
        title={"text": panel.title, "font": {"size": 15}},
        template="plotly_white",
        height=380 if panel.labelled else 560,
        margin={"l": 60, "r": 20, "t": 50, "b": 50},
        xaxis={
            "title": "processor seconds",
            "type": "log",
            "tickvals": ticks(panel.span_s),
            "range": _range(panel.span_s, log=True, right=_LABEL_ROOM if panel.labelled else _ROOM),
        },
        yaxis={
            "title": {"text": panel.axis_name, "font": {"size": 11}},
            "type": "log" if panel.log_y else "linear",
            **({"tickvals": ticks([dot.accuracy or 0.0 for dot in panel.done])} if panel.log_y else {}),
            "range": _range([*panel.heights, _floor(panel)], panel.log_y)[:: -1 if panel.lower_is_better else 1],
        },
        legend={"orientation": "h", "y": -0.2},
    )


def _range(values: Sequence[float], log: bool, right: float = _ROOM) -> list[float]:
    """Return the ends of an axis with some room; plotly takes those of a log axis as exponents."""
    shown = np.log10(values) if log else np.asarray(values)
    below, above = (max(share * float(np.ptp(shown)), _LEAST_ROOM) for share in (_ROOM, right))
    return [float(shown.min()) - below, float(shown.max()) + above]


def _floor(panel: Panel) -> float:
    """Return where failures lie: below everything else."""
    known = panel.heights or [1.0]
    shown = np.log10(known) if panel.log_y else np.asarray(known)
    room = max(_FLOOR_SHARE * float(np.ptp(shown)), _LEAST_ROOM)
    floor = float(shown.max()) + room if panel.lower_is_better else float(shown.min()) - room
    return 10.0**floor if panel.log_y else floor


def _dots(figure: go.Figure, mark: Mark, dots: Sequence[Dot], off: bool) -> None:
    if not dots:
        return
    figure.add_scatter(
        x=[dot.seconds for dot in dots],
        y=[dot.accuracy for dot in dots],
        mode="markers",
        name=f"{_CALLED[mark]}, another test" if off else _CALLED[mark],
        text=[dot.hover or escape(dot.label) for dot in dots],
        hovertemplate="%{text}<extra></extra>",
        marker={
            "size": 16 if mark == "chosen" else 10,
            "color": COLOURS[mark],
            "symbol": _SHAPES[mark] + ("-open" if off else ""),
        },
        error_y={
            "type": "data",
            "symmetric": False,
            # The dot is a median and the interval of a mean: it may lie to one side of the dot
            "array": [max(dot.interval[1] - (dot.accuracy or 0.0), 0.0) if dot.interval else 0.0 for dot in dots],
            "arrayminus": [max((dot.accuracy or 0.0) - dot.interval[0], 0.0) if dot.interval else 0.0 for dot in dots],
            "thickness": 0.6,
            "width": 0,
        },
    )


def _failures(figure: go.Figure, panel: Panel) -> None:
    """Put what failed on a line below everything else."""
    failed = [dot for dot in panel.dots if dot.accuracy is None]
    if not failed:
        return
    figure.add_scatter(
        x=[max(dot.seconds, panel.fastest_s) for dot in failed],
        y=[_floor(panel)] * len(failed),
        mode="markers",
        name="failed",
        text=[dot.hover or dot.label for dot in failed],
        hovertemplate="%{text}<extra></extra>",
        marker={"size": 10, "color": FLOOR, "symbol": "x-thin", "line": {"width": 2, "color": FLOOR}},
    )
