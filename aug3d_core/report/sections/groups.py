"""Groups: similarity of photographs, the groups, and a comparison of the grouping methods."""

from __future__ import annotations

from collections.abc import Hashable
from html import escape
from typing import Any

import numpy as np
import pandas as pd

from aug3d_core.judging.files import TEST_VIEWS
from aug3d_core.overlap.files import OVERLAP_MEMBERS, OVERLAP_TABLE
from aug3d_core.report.html import number, percent, spaced, table, tag
from aug3d_core.report.reported_run import ReportedRun

_MOST_ROWS = 300
_KINDS = {"scene": "training", "test": "test"}  # of groups, by their names in the overlap stage


def groups(run: ReportedRun) -> str:
    """Return the groups of one fold."""
    alike = run.pictures("similarity") if not run.fold else ""
    pictures = alike + run.pictures("overlap")
    return _said(run) + (tag("div", pictures, class_="card pictures") if pictures else "") + _ways(run) + _each(run)


def _said(run: ReportedRun) -> str:
    record = run.record("grouping")
    if record is None:
        return ""
    figures = record.metrics
    roles = ", ".join(
        f"{figures[f'{role}_views']} {word}"
        for role, word in (
            ("train", "for training"),
            ("spare", "spare, as others show the same"),
            ("gap", "in the gap"),
            ("support", "support"),
            ("target", "held out"),
        )
        if figures.get(f"{role}_views") is not None
    )
    groups, k = (number(figures.get(name)) for name in ("groups", "k"))
    text = f"{groups} training groups of {k} by {spaced(str(figures.get('method')))}"
    bad = run.figure("overlap", "bad_members_share")
    seen = (
        f" {percent(bad, 1)} of the members see less than 10 % of the surface that their group's centre sees."
        if bad is not None
        else ""
    )
    return tag("p", f"{text}; photographs: {roles}.{seen}")


def _ways(run: ReportedRun) -> str:
    """Return a row per grouping method: the share of members with almost no overlap with their centre."""
    ways = [row for row in run.table("overlap", OVERLAP_TABLE).to_dict("records") if row["method"] not in _KINDS]
    if not ways:
        return ""
    sizes = sorted({row["k"] for row in ways})
    by_way = {(row["method"], row["k"]): row for row in ways}
    rows = []
    for method in dict.fromkeys(row["method"] for row in ways):
        each = [by_way.get((method, k)) for k in sizes]
        bad = [percent(row["bad_members_share"], 1) if row else "-" for row in each]
        alike = [percent(row["overlap_mean"]) if row else "-" for row in each]
        rows.append(
            (tag("b", spaced(method)) if method == run.metric("grouping", "method") else spaced(method), *bad, *alike)
        )
    heads = ("method", *(f"bad, K = {k}" for k in sizes), *(f"overlap, K = {k}" for k in sizes))
    said = (
        "Groups around the same centres with every method; that of this run in bold. Bad: a member that sees less than 10 %"
        " of the centre's surface."
    )
    return tag("h3", "Grouping methods") + tag("p", said, class_="dim") + table(heads, rows, range(1, len(heads)))


def _each(run: ReportedRun) -> str:
    """Return a row per group: its centre, and the overlap of its members with it."""
    groups: dict[tuple[str, int], list[dict[Hashable, Any]]] = {}
    for member in run.table("overlap", OVERLAP_MEMBERS).to_dict("records"):
        if member["method"] in _KINDS:
            groups.setdefault((member["method"], member["group"]), []).append(member)
    psnr, rows = _test_psnr(run), []
    for (method, group), members in groups.items():
        centre = int(members[0]["centre_photo_id"])
        shared = np.array([member["shared_points"] for member in members])
        overlap = np.array([member["overlap"] for member in members], float)
        judged = np.isfinite(overlap).any()
        rows.append((
            _KINDS[method], str(group), escape(run.called(centre)), str(len(members) + 1), f"{shared.mean():,.0f}",
            f"{shared.min():,}", percent(float(np.nanmean(overlap))) if judged else "-",
            percent(float(np.nanmin(overlap))) if judged else "-", psnr.get(centre, "-") if method == "test" else "",
        ))  # fmt: skip
    if not rows:
        return ""
    heads = ("for", "group", "centre", "photographs", "shared points", "fewest", "overlap", "least", "PSNR [dB]")
    more = f", the first {_MOST_ROWS} of {len(rows)}" if len(rows) > _MOST_ROWS else ""
    said = f"Points and surface that members share with their centre{more}."
    shown = tag("div", table(heads, rows[:_MOST_ROWS], numeric=(1, *range(3, 9))), class_="tall")
    return tag("h3", "All groups") + tag("p", said, class_="dim") + shown


def _test_psnr(run: ReportedRun) -> dict[int, str]:
    """Return the model's PSNR on each held-out photograph, as text."""
    views: pd.DataFrame = run.table("evaluation", TEST_VIEWS)
    return {int(row["photo_id"]): f"{row['psnr']:.2f}" for row in views.to_dict("records")}
