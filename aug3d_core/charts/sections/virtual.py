"""Virtual views: where domes stand, what was rejected and why, what was rendered."""

from __future__ import annotations

import re
from collections import Counter
from html import escape

import numpy as np

from aug3d_core.charts.html import percent, spaced, table, tag
from aug3d_core.charts.sections.run import Run
from aug3d_core.store import layout

_REJECTED = {
    "inside": "inside the surface",
    "under": "under the surface",
    "too_near": "too near the surface",
    "aim_hidden": "what it looks at is hidden",
    "empty": "sees too little surface",
    "back_faces": "sees the surface from behind",
    "black": "sees what no photograph coloured",
    "smeared": "sees texture finer than the photographs justify",
}
_MOST_ROWS = 300


def virtual_views(run: Run) -> str:
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


def _said(run: Run) -> str:
    planned, kept = run.figure("sampling", "views_planned"), run.figure("rendering", "kept")
    reach, photos = run.figure("sampling", "reach_share"), run.figure("sampling", "photos_reach_share")
    said = f"{tag('b', _count(planned))} virtual views on {_count(run.figure('sampling', 'domes'))} domes"
    said += f", {tag('b', _count(kept))} rendered and kept." if kept is not None else "."
    if reach is not None and photos is not None:
        seen = f"{percent(photos)} by the photographs, {percent(reach)} with the virtual views"
        said += f" Surface seen from its directions: {seen}."
    return said


def _cameras(run: Run) -> str:
    """Return how many cameras were tried, and what became of them."""
    tried, planned = (run.figure("sampling", name) for name in ("cameras_tried", "views_planned"))
    if not tried or planned is None:
        return ""
    rejected = {name: run.figure("sampling", f"rejected_{name}") or 0.0 for name in _REJECTED}
    rows = [("tried", _count(tried), "")]
    rows += [(f"rejected: {_REJECTED[name]}", _count(n), percent(n / tried, 1)) for name, n in rejected.items() if n]
    none = [_REJECTED[name] for name, n in rejected.items() if not n]
    rows += [(f"rejected: {', '.join(none)}", "0", "")] if none else []
    unused = tried - sum(rejected.values()) - planned
    rows.append(("could be used, but add too little", _count(unused), percent(unused / tried, 1)))
    rows.append((tag("b", "kept"), tag("b", _count(planned)), percent(planned / tried, 1)))
    return tag("div", tag("h3", "Cameras drawn") + table(("cameras", "count", "share"), rows, numeric=(1, 2)))


def _places(run: Run) -> str:
    """Return how many places for domes there were, and why the others were passed over."""
    domes = run.table("sampling", layout.DOME_TABLE).to_dict("records")
    if not domes:
        return ""
    reasons = Counter(_reason(dome["why"]) for dome in domes if not dome["views"])
    rows = [(f"passed over: {escape(why)}", str(count)) for why, count in reasons.most_common()]
    rows.append((tag("b", "a dome stands"), tag("b", str(len(domes) - reasons.total()))))
    return tag("div", tag("h3", "Places for domes") + table(("places", "count"), rows, numeric=(1,)))


def _reason(why: str) -> str:
    """Return why a place was passed over, without the figures that differ from place to place."""
    said = re.split(r"left out: |passed over: ", why)[-1]
    most = re.search(r"most others: (.*)", said)
    if most:
        return f"cameras that {_REJECTED.get(most[1].replace(' ', '_'), most[1])}".replace("that sees", "that see")
    return re.sub(r"surface under [\d.]+ % of the view", "too little surface under the view", said)


def _renders(run: Run) -> str:
    """Return what became of the rendered views."""
    renders = run.table("rendering", layout.RENDER_TABLE).to_dict("records")
    if not renders:
        return ""
    dropped = Counter(str(render["reason"]) for render in renders if not render["kept"])
    rows = [(f"dropped: {escape(why)}", str(count)) for why, count in dropped.most_common()] or [("dropped", "0")]
    rows.append((tag("b", "kept"), tag("b", str(len(renders) - dropped.total()))))
    return tag("div", tag("h3", "Rendered views") + table(("views", "count"), rows, numeric=(1,)))


def _every_dome(run: Run) -> str:
    """Return a row per place, those with a dome first."""
    domes = run.table("sampling", layout.DOME_TABLE)
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
        "why here, or why not",
    )
    shown = table(heads, rows, numeric=range(len(heads) - 1))
    return tag(
        "details", tag("summary", "Every place: cameras tried, rejected, and why") + tag("div", shown, class_="tall")
    )


def _count(value: float | None) -> str:
    return "-" if value is None else f"{value:,.0f}"
