"""Ground control points: how far off the reconstruction is at each."""

from __future__ import annotations

from html import escape

import numpy as np
import pandas as pd

from aug3d_core.report.html import number, table, tag
from aug3d_core.report.reported_run import ReportedRun
from aug3d_core.sfm.files import CONTROL_POINTS

_AXES = ("east", "north", "up")
_ORDER = ("check", "control", "wrong")


def surveyed(run: ReportedRun) -> pd.DataFrame:
    """Return the control points that told the world; no rows if none did."""
    points = run.table("sfm", CONTROL_POINTS)
    return points if "error_up_m" in points else pd.DataFrame()


def control_points(run: ReportedRun) -> str:
    """Return the errors at control and check points, as surveyors report them."""
    points = surveyed(run)
    if points.empty:
        return ""
    placed = run.record("sfm")
    metrics = placed.metrics if placed else {}
    said = [
        f"{tag('b', words)}: {metrics[f'{role}_error_horizontal_m']:.3f} m across, "
        f"{metrics[f'{role}_error_up_m']:.3f} m up (RMS of {metrics[f'{role}_points']})."
        for role, words in (("check", "Check points"), ("control", "Control points, each left out in its turn"))
        if metrics.get(f"{role}_error_up_m") is not None
    ]
    rows = [
        (
            escape(point["point"]),
            escape(point["role"]),
            number(int(point["marks"])),
            f"{point['marks_px']:.1f}",
            *(_metres(point[f"error_{axis}_m"]) for axis in _AXES),
            *(_metres(point[f"residual_{axis}_m"]) for axis in _AXES),
        )
        for point in sorted(points.to_dict("records"), key=lambda point: _ORDER.index(point["role"]))
    ]
    heads = ("point", "role", "photographs", "marks off [px]", *(f"{axis} [m]" for axis in _AXES))
    fitted = tuple(f"{axis}, fitted [m]" for axis in _AXES)
    how = "The error of a point is that of the world which the other control points tell."
    if metrics.get("control_adjusted"):
        how += (
            f" Poses and lens were adjusted to the control points: points that had no part are"
            f" {metrics['control_left_out_m_adjusted']:.3f} m off, {metrics['control_left_out_m_moved']:.3f} m if the world is"
            " only moved."
        )
    return tag(
        "div",
        tag("h3", "Control points")
        + tag("p", f"{' '.join(said)} {how}")
        + table((*heads, *fitted), rows, numeric=range(2, 10)),
        class_="card",
    )


def _metres(value: float) -> str:
    return f"{value:+.3f}" if np.isfinite(value) else "-"
