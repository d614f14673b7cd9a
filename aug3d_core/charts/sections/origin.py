"""What it takes to get the same again: digests, engine versions, seeds, settings; and every figure."""

from __future__ import annotations

import json
from html import escape

from aug3d_core.charts.html import number, spaced, table, tag
from aug3d_core.charts.sections.run import Run


def origin(run: Run) -> str:
    """Return where a version comes from."""
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
    }  # the page travels, folders do not
    figures = escape(json.dumps(shareable, indent=1))
    raw = tag("details", tag("summary", "All figures (metrics.json)") + tag("pre", figures))
    return table(heads, rows) + settings + raw
