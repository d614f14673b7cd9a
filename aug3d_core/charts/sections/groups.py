"""Which photographs belong together: likeness of every pair, the groups, and every way of grouping beside the other."""

from __future__ import annotations

from collections.abc import Hashable
from html import escape
from typing import Any

import numpy as np
import pandas as pd

from aug3d_core.charts.html import number, percent, spaced, table, tag
from aug3d_core.charts.sections.run import Run
from aug3d_core.store import layout

_MOST_ROWS = 300
_KINDS = {"scene": "training", "test": "test"}  # of groups, as the overlap stage calls them


def groups(run: Run) -> str:
    """Return the groups of one fold."""
    alike = run.pictures("similarity") if not run.fold else ""
    pictures = alike + run.pictures("overlap")
    return _said(run) + (tag("div", pictures, class_="card pictures") if pictures else "") + _ways(run) + _each(run)


def _said(run: Run) -> str:
    record = run.record("grouping")
    if record is None:
        return ""
    figures = record.metrics
    roles = ", ".join(
        f"{figures[f'{role}_views']} {word}"
        for role, word in (
            ("train", "for training"),
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
        f" {percent(bad, 1)} of the members see under 10 % of what their group's centre sees."
        if bad is not None
        else ""
    )
    return tag("p", f"{text}; photographs: {roles}.{seen}")


def _ways(run: Run) -> str:
    """Return a row per way of grouping: the share of members that see next to nothing of their centre."""
    ways = [row for row in run.table("overlap", layout.OVERLAP_TABLE).to_dict("records") if row["method"] not in _KINDS]
    if not ways:
        return ""
    sizes = sorted({row["k"] for row in ways})
    by_way = {(row["method"], row["k"]): row for row in ways}
    rows = []
    for method in dict.fromkeys(row["method"] for row in ways):
        each = [by_way.get((method, k)) for k in sizes]
        bad = [percent(row["bad_members_share"], 1) if row else "-" for row in each]
        alike = [percent(row["overlap_mean"]) if row else "-" for row in each]
        rows.append((spaced(method), *bad, *alike))
    heads = ("way of grouping", *(f"bad of {k}" for k in sizes), *(f"overlap of {k}" for k in sizes))
    said = (
        "Groups at the same places by every way. Bad: a member that sees under 10 % of the same surface as the centre."
    )
    return tag("h3", "Ways of grouping") + tag("p", said, class_="dim") + table(heads, rows, range(1, len(heads)))


def _each(run: Run) -> str:
    """Return a row per group: its centre, and what its members share with it."""
    groups: dict[tuple[str, int], list[dict[Hashable, Any]]] = {}
    for member in run.table("overlap", layout.OVERLAP_MEMBERS).to_dict("records"):
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
    heads = ("for", "group", "centre", "photographs", "shared points", "fewest", "overlap", "least", "PSNR (dB)")
    more = f", the first {_MOST_ROWS} of {len(rows)}" if len(rows) > _MOST_ROWS else ""
    said = f"What members share with their centre{more}: points, and surface that both see."
    shown = tag("div", table(heads, rows[:_MOST_ROWS], numeric=(1, *range(3, 9))), class_="tall")
    return tag("h3", "Every group") + tag("p", said, class_="dim") + shown


def _test_psnr(run: Run) -> dict[int, str]:
    """Return the model's PSNR at each held-out photograph, as text."""
    views: pd.DataFrame = run.table("evaluation", layout.TEST_VIEWS)
    return {int(row["photo_id"]): f"{row['psnr']:.2f}" for row in views.to_dict("records")}
