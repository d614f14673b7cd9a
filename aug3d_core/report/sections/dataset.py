"""The data set: its views and groups, and the leak audit."""

from __future__ import annotations

import json
from html import escape

from aug3d_core.dataset.files import LEAK_AUDIT
from aug3d_core.report.html import number, table, tag
from aug3d_core.report.reported_run import ReportedRun


def packed(run: ReportedRun) -> str:
    """Return the contents of the data set, and its leak audit in every fold."""
    record = run.record("dataset")
    if record is None:
        return ""
    m = record.metrics
    said = (
        f"{number(m.get('views'))} views: {number(m.get('real'))} real, {number(m.get('rendered'))} rendered."
        f" Groups: {number(m.get('groups_real'))} real, {number(m.get('groups_rendered'))} rendered,"
        f" {number(m.get('groups_test'))} for the test."
    )
    pictures = run.pictures("dataset")
    shown = tag("div", pictures, class_="card") if pictures else ""
    return tag("p", said) + tag("div", tag("div", leak_audit(run)) + shown, class_="halves")


def leak_audit(run: ReportedRun) -> str:
    """Return a row per check of the leak audit, with its figure in each fold; bold where the bound is exceeded."""
    files = [run.in_fold(fold).file("dataset", LEAK_AUDIT) for fold in range(run.folds)]
    audits = [json.loads(file.read_text())["checks"] for file in files if file]
    if not audits:
        return ""
    rows = []
    for same in zip(*audits, strict=True):
        cells = [
            number(check["figure"]) if check["passed"] else tag("b", number(check["figure"]), class_="degraded")
            for check in same
        ]
        rows.append((escape(same[0]["check"]), escape(same[0]["bound"]), *cells))
    heads = ("check", "bound", *(f"fold {fold}" if len(audits) > 1 else "figure" for fold in range(len(audits))))
    intro = "Checks that no test photograph reached training, directly or through the mesh and its texture."
    return tag("h3", "Leak audit") + tag("p", intro, class_="dim") + table(heads, rows, range(2, len(heads)))
