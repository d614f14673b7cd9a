"""Control points are told as surveyors report them, in a table and on the map."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pandas as pd

from aug3d_core.report.reported_run import ReportedRun
from aug3d_core.report.sections.cameras import cameras
from aug3d_core.report.sections.control import control_points
from aug3d_core.report.sections.overview import overview
from aug3d_core.report.sections.verdicts import verdicts
from aug3d_core.sfm.files import CONTROL_POINTS, WORLD
from tests.report.made_up_run import EVIL, flown

POINTS = pd.DataFrame(
    {
        "point": ["A", EVIL, "CHK"],
        "role": ["control", "wrong", "check"],
        "marks": [5, 4, 3],
        "marks_px": [0.51, 0.4, 0.3],
        "x_m": [0.0, 50, 100],
        "y_m": [0.0, 10, 30],
        **{f"residual_{axis}_m": [0.01, 3.0, 0.02] for axis in ("east", "north", "up")},
        **{f"error_{axis}_m": [float("nan"), 3.0, 0.04] for axis in ("east", "north", "up")},
    }
)


def placed(run: ReportedRun) -> dict[str, Any]:
    record = run.record("sfm")
    assert record is not None
    return record.metrics


def test_errors_are_in_the_table_and_on_the_map(tmp_path: Path) -> None:
    run = flown(tmp_path)
    assert control_points(run) == "" and 'class="point' not in overview(run)
    POINTS.to_parquet(tmp_path / "sfm" / CONTROL_POINTS)
    placed(run).update(check_points=1, check_error_horizontal_m=0.0566, check_error_up_m=0.04)
    page = cameras(run)
    assert "<b>Check points</b>: 0.057 m across, 0.040 m up (RMS of 1)" in page
    assert "left out in its turn" not in page, "it has no figure"
    assert "adjusted to the control points" not in page
    placed(run).update(control_adjusted=True, control_left_out_m_adjusted=0.0312, control_left_out_m_moved=0.4)
    assert "adjusted to the control points: points that had no part are 0.031 m off, 0.400 m if" in cameras(run)
    rows = re.findall(r"<tr><td[^>]*>(?:CHK|A|&lt;).*?</tr>", control_points(run))
    assert "+0.040" in rows[0] and "CHK" in rows[0] and ">-<" in rows[1] and EVIL not in page
    drawn = overview(run)
    assert [drawn.count(f'class="point {role}"') for role in ("control", "wrong", "check")] == [1, 1, 1]
    assert EVIL not in drawn and "CHK (check): east +0.04" in drawn


def test_metres_by_control_points_are_not_called_nominal(tmp_path: Path) -> None:
    run = flown(tmp_path)
    placed(run)["gps_residual_m_median"] = None
    (tmp_path / "sfm" / WORLD).write_text('{"metric": true, "unit": "m", "origin": null}')
    assert any(verdict.what == "GPS" for verdict in verdicts(run)) and "nominal" in cameras(run)
    POINTS.to_parquet(tmp_path / "sfm" / CONTROL_POINTS)
    assert not any(verdict.what == "GPS" for verdict in verdicts(run)) and "nominal" not in cameras(run)
