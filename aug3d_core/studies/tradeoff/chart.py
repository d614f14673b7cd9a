"""The points of a study as charts."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from aug3d_core.report.front import Dot, Mark, Panel
from aug3d_core.report.html import duration, number
from aug3d_core.studies.tradeoff.arm import FACTORY
from aug3d_core.studies.tradeoff.findings import panels
from aug3d_core.studies.tradeoff.point import Point, below, best
from aug3d_core.studies.tradeoff.study import TradeoffFindings

_MOST_LABELS = 6  # more labels would overlap


def charts(found: TradeoffFindings) -> list[Panel]:
    """Return a panel for the whole factory, and one for each setting."""
    return [_panel(points, found.chosen) for points in panels(found)]


def _panel(points: Sequence[Point], chosen: Point | None) -> Panel:
    judge, top = points[0].arm.judge, best(points)
    dots = tuple(_dot(point, chosen, top) for point in points)
    whole = points[0].arm.panel == FACTORY
    return Panel(
        points[0].arm.panel, judge.name, judge.lower_is_better, dots, not whole and len(points) <= _MOST_LABELS
    )


def _dot(point: Point, chosen: Point | None, top: Point | None) -> Dot:
    mark: Mark = "chosen" if chosen is not None and point.arm == chosen.arm else point.arm.mark
    return Dot(
        label=point.arm.label if point.arm.panel == FACTORY else f"{point.arm.label}  ({_peak(point):,.0f} MiB)",
        seconds=point.cpu_seconds,
        accuracy=point.accuracy,
        repeats=tuple((result.cpu_seconds, result.accuracy) for result in point.results if result.accuracy is not None),
        interval=_interval(point, top) if mark else None,  # intervals of all dots would hide the dots
        mark=mark,
        off=not point.comparable,
        hover=_hover(point),
    )


def _interval(point: Point, top: Point | None) -> tuple[float, float] | None:
    """Return the range of a point by the interval of its difference from the best of the panel."""
    apart = below(point, top) if top is not None and top is not point else None
    if top is None or apart is None or apart.interval is None:
        return None
    low, high = apart.interval
    return (top.accuracy or 0.0) - high, (top.accuracy or 0.0) - low


def _peak(point: Point) -> float:
    return max(result.peak_mib for result in point.results)


def _hover(point: Point) -> str:
    wall = max(result.seconds for result in point.results)
    failures = dict.fromkeys(result.failure for result in point.results if result.failure)
    lines = [
        f"<b>{escape(point.arm.label)}</b>",
        f"{escape(point.arm.judge.name)} {number(point.accuracy)}, seeds: {len(point.results)}",
        f"{duration(point.cpu_seconds)} of the processors, {duration(wall)} by the clock at most",
        f"{_peak(point):,.0f} MiB, {max(r.size_bytes for r in point.results) / 2**20:,.1f} MiB on the disk",
        *map(escape, failures),
    ]
    return "<br>".join(lines + ([] if point.comparable else ["judged on other photographs"]))
