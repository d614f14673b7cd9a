"""The scene report: all results of a run, as one HTML page that needs no network."""

from __future__ import annotations

import base64
import hashlib
import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from html import escape
from pathlib import Path
from typing import Any

from aug3d_core.metrics.comparison import Comparison
from aug3d_core.metrics.scene_metrics import Made
from aug3d_core.report.html import page, tag
from aug3d_core.report.report_script import SCRIPT
from aug3d_core.report.report_style import REPORT_STYLE
from aug3d_core.report.reported_run import ReportedRun
from aug3d_core.report.sections.answer import answer
from aug3d_core.report.sections.answers import test, training
from aug3d_core.report.sections.cameras import cameras
from aug3d_core.report.sections.compared import beside_published
from aug3d_core.report.sections.cost import cost
from aug3d_core.report.sections.dataset import packed
from aug3d_core.report.sections.groups import groups
from aug3d_core.report.sections.headline import beside_cheap, failure, headline, notes
from aug3d_core.report.sections.needs import needs
from aug3d_core.report.sections.origin import origin
from aug3d_core.report.sections.overview import overview
from aug3d_core.report.sections.surface import depth_and_mesh
from aug3d_core.report.sections.tracks import tracks
from aug3d_core.report.sections.verdicts import lights, verdicts
from aug3d_core.report.sections.virtual import virtual_views

Section = Callable[[ReportedRun], str]


def write_report(records: Made, metrics: Mapping[str, Any], out: Path, compared: Comparison | None = None) -> None:
    """Write the report of a complete or failed run; `metrics` is the content of its metrics.json.

    compared: the published version (first) and this one (second).
    """
    run = ReportedRun(records, metrics)
    sections: dict[str, Section] = {
        "Answer": answer,
        "Summary": _summary,
        "Changes": lambda _: beside_published(compared),
        "Map": _in_folds(overview),
        "Cameras": cameras,
        "Overlap": tracks,
        "Groups": _in_folds(groups),
        "Depth and mesh": _in_folds(depth_and_mesh),
        "Virtual views": _in_folds(virtual_views),
        "Data set": packed,
        "Training": training,
        "Test": test,
        "Decisions": _in_folds(needs),
        "Cost": cost,
        "Origin": origin,
    }
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:  # most of the time goes into encoding pictures
        drawn = dict(zip(sections, pool.map(lambda section: _guarded(section, run), sections.values()), strict=True))
    out.write_text(_page(run, {title: content for title, content in drawn.items() if content}), encoding="utf-8")


def _summary(run: ReportedRun) -> str:
    return failure(run) + beside_cheap(run) + lights(verdicts(run)) + notes(run)


def _in_folds(section: Section) -> Section:
    """Return a section for every fold; later folds are folded up."""

    def all_folds(run: ReportedRun) -> str:
        shown = section(run)
        for fold in range(1, run.folds):
            content = section(run.in_fold(fold))
            shown += tag("details", tag("summary", f"Fold {fold}") + content) if content else ""
        return shown

    return all_folds


def _guarded(section: Section, run: ReportedRun) -> str:
    """Return a section, or the reason why it cannot be drawn."""
    try:
        return section(run)
    except Exception as error:  # a broken file or chart must not prevent the report
        return tag("p", f"This section could not be drawn: {escape(repr(error))}", class_="note")


def _page(run: ReportedRun, sections: Mapping[str, str]) -> str:
    """Return the page: headline, table of contents, and every section that is not empty."""
    anchors = {title: title.lower().replace(" ", "-") for title in sections}
    links = "".join(tag("a", escape(title), href=f"#{anchor}") for title, anchor in anchors.items())
    body = "".join(
        tag("section", tag("h2", escape(title)) + content, id=anchors[title]) for title, content in sections.items()
    )
    digest = base64.b64encode(hashlib.sha256(SCRIPT.encode()).digest()).decode()
    # Nothing is loaded and no other script runs, whatever a file name or a note contains
    policy = (
        f"default-src 'none'; img-src data:; media-src data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"
    )
    head = f'<meta http-equiv="Content-Security-Policy" content="{policy}">' + tag("style", REPORT_STYLE)
    content = headline(run) + tag("nav", links, aria_label="Contents") + body
    return page(f"{run.metrics['scene']} - aug3d", content, head, f"{tag('dialog', '')}<script>{SCRIPT}</script>")
