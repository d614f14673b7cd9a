"""What is needed to reproduce the run: digests, engine versions, seeds, settings; and all metrics."""

from __future__ import annotations

import json
from html import escape

from aug3d_core.report.html import number, spaced, table, tag
from aug3d_core.report.reported_run import ReportedRun


def origin(run: ReportedRun) -> str:
    """Return the origin of a version."""
    rows = [
        (
            spaced(step.name),
            tag("code", escape(record.key[:16])),
            tag("code", escape(record.digest[:16])),
            escape(", ".join(f"{name} {version}" for name, version in record.versions.items())) or "-",
            number(record.config.get("seed")),
        )
        for step, record, _ in run.made
    ]
    heads = ("stage", "key", "digest of the files", "engines", "seed")
    config = json.dumps({step.name: record.config for step, record, _ in run.made}, indent=1)
    settings = tag("details", tag("summary", "All settings") + tag("pre", escape(config)))
    shareable = {
        name: value for name, value in run.metrics.items() if name != "paths"
    }  # the page is shared, the folders are not
    figures = escape(json.dumps(shareable, indent=1))
    raw = tag("details", tag("summary", "All metrics (metrics.json)") + tag("pre", figures))
    return table(heads, rows) + settings + raw
