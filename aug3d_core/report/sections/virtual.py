"""Virtual views: domes, rejected cameras with reasons, rendered views."""

from __future__ import annotations

import re
from collections import Counter
from html import escape

import numpy as np

from aug3d_core.domes.files import DOME_TABLE
from aug3d_core.rendering.files import RENDER_TABLE
from aug3d_core.report.html import percent, spaced, table, tag
from aug3d_core.report.reported_run import ReportedRun

_REJECTED = {
    "inside": "inside the surface",
    "under": "under the surface",
    "too_near": "too close to the surface",
    "aim_hidden": "its target is hidden",
    "empty": "sees too little surface",
    "back_faces": "sees the surface from behind",
    "black": "sees surface that no photograph coloured",
    "smeared": "needs finer texture than the photographs have",
}
_MOST_ROWS = 300


def virtual_views(run: ReportedRun) -> str:
    """Return the virtual views of one fold."""
    if run.record("sampling") is None:
        return ""
    pictures = run.pictures("sampling") + run.pictures("rendering")
    return (
        tag("p", _said(run))
        + (tag("div", pictures, class_="card pictures") if pictures else "")
        + tag("div", _cameras(run) + _places(run) + _renders(run), class_="tables")
        + _every_dome(run)
    )


def _said(run: ReportedRun) -> str:
    planned, kept = run.figure("sampling", "views_planned"), run.figure("rendering", "kept")
    reach, photos = run.figure("sampling", "reach_share"), run.figure("sampling", "photos_reach_share")
    said = f"{tag('b', _count(planned))} virtual views on {_count(run.figure('sampling', 'domes'))} domes"
    said += f", {tag('b', _count(kept))} rendered and kept." if kept is not None else "."
    if reach is not None and photos is not None:
        seen = f"{percent(photos)} by the photographs, {percent(reach)} with the virtual views"
        said += f" Share of surface directions that are seen: {seen}."
    return said


def _cameras(run: ReportedRun) -> str:
    """Return how many cameras were tried, kept and rejected."""
    tried, planned = (run.figure("sampling", name) for name in ("cameras_tried", "views_planned"))
    if not tried or planned is None:
        return ""
    rejected = {name: run.figure("sampling", f"rejected_{name}") or 0.0 for name in _REJECTED}
    rows = [("tried", _count(tried), "")]
    rows += [(f"rejected: {_REJECTED[name]}", _count(n), percent(n / tried, 1)) for name, n in rejected.items() if n]
    none = [_REJECTED[name] for name, n in rejected.items() if not n]
    rows += [(f"rejected: {', '.join(none)}", "0", "")] if none else []
    unused = tried - sum(rejected.values()) - planned
    rows.append(("usable, but add too little", _count(unused), percent(unused / tried, 1)))
    rows.append((tag("b", "kept"), tag("b", _count(planned)), percent(planned / tried, 1)))
    return tag("div", tag("h3", "Virtual cameras") + table(("cameras", "count", "share"), rows, numeric=(1, 2)))


def _places(run: ReportedRun) -> str:
    """Return how many places for domes there were, and why some were rejected."""
    domes = run.table("sampling", DOME_TABLE).to_dict("records")
    if not domes:
        return ""
    reasons = Counter(_reason(dome["why"]) for dome in domes if not dome["views"])
    rows = [(f"rejected: {escape(why)}", str(count)) for why, count in reasons.most_common()]
    rows.append((tag("b", "dome placed"), tag("b", str(len(domes) - reasons.total()))))
    return tag("div", tag("h3", "Places for domes") + table(("places", "count"), rows, numeric=(1,)))


def _reason(why: str) -> str:
    """Return why a place was rejected, without the figures that differ between places."""
    said = re.split(r"left out: |passed over: ", why)[-1]
    most = re.search(r"most others: (.*)", said)
    if most:
        return f"most cameras ({_REJECTED.get(most[1].replace(' ', '_'), most[1])})"
    return re.sub(r"surface under [\d.]+ % of the view", "too little surface under the view", said)


def _renders(run: ReportedRun) -> str:
    """Return how many rendered views were kept and dropped."""
    renders = run.table("rendering", RENDER_TABLE).to_dict("records")
    if not renders:
        return ""
    dropped = Counter(str(render["reason"]) for render in renders if not render["kept"])
    rows = [(f"dropped: {escape(why)}", str(count)) for why, count in dropped.most_common()] or [("dropped", "0")]
    rows.append((tag("b", "kept"), tag("b", str(len(renders) - dropped.total()))))
    return tag("div", tag("h3", "Rendered views") + table(("views", "count"), rows, numeric=(1,)))


def _every_dome(run: ReportedRun) -> str:
    """Return a row per place, those with a dome first."""
    domes = run.table("sampling", DOME_TABLE)
    if domes.empty:
        return ""
    rejected = [name for name in _REJECTED if np.any(domes[f"rejected_{name}"])]
    rows = [
        (
            str(dome["dome_id"]) if dome["views"] else "-", *(f"{dome[name]:.1f}" for name in ("x", "y", "radius", "cell")),
            str(dome["views"]), str(dome["tried"]), *(str(dome[f"rejected_{name}"]) for name in rejected), escape(dome["why"]),
        )
        for dome in domes.sort_values("views", ascending=False, kind="stable").head(_MOST_ROWS).to_dict("records")
    ]  # fmt: skip
    heads = (
        "dome",
        "x",
        "y",
        "radius",
        "cell",
        "views",
        "tried",
        *(spaced(name) for name in rejected),
        "reason",
    )
    shown = table(heads, rows, numeric=range(len(heads) - 1))
    return tag(
        "details",
        tag("summary", "All places: cameras tried and rejected, with the reason") + tag("div", shown, class_="tall"),
    )


def _count(value: float | None) -> str:
    return "-" if value is None else f"{value:,.0f}"
