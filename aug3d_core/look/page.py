"""The first look as one HTML file that needs no network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from shlex import quote

import numpy as np
from jaxtyping import Bool

from aug3d_core.factory.estimate.cost import Cost
from aug3d_core.look.findings import Finding, blurred, exposed_unlike, verdict_of
from aug3d_core.look.ground import Ground
from aug3d_core.look.survey import Survey
from aug3d_core.report.html import data_uri, number, page, table, tag
from aug3d_core.report.sections.map_layers import cells, lines, scale_bar
from aug3d_core.report.svg import curve, svg
from aug3d_core.report.top_view import Frame

_MAP_PX, _LEAST_RADIUS_PX = 1100, 5.0
_MOST_PICTURES = 400  # of those that nothing is wrong with
_NAMED = 12  # photographs of a finding whose names are shown at once
_SEEN = (  # how many photographs see a place, from so many on: colour
    (0, (196, 50, 40)), (3, (233, 170, 60)), (5, (160, 200, 90)), (9, (46, 140, 80)),
)  # fmt: skip
_ALPHA_INSIDE, _ALPHA_OUTSIDE = 200, 70
_MAP_SAYS = "North is up. The white line is the order of capture. Pale: beyond what the flight encloses."
_WORDS = {
    "stop": ("refused", "will not work"),
    "warn": ("degraded", "look at it"),
    "note": ("ok", "good to know"),
    "none": ("ok", "looks good"),
}
_STYLE = """<style>
.finding{border-left:4px solid currentColor;padding:4px 0 4px 14px;margin:12px 0}.finding>*{color:var(--ink)}
.finding>.badge{color:inherit;border:0;padding:0}.finding p{margin:2px 0}.finding .do{color:var(--dim)}
.map{display:block}.map path.flown{stroke:#fff;stroke-width:1.6;opacity:.8;fill:none}
.map .at{fill:#fff;stroke:#222;stroke-width:1.5}.map .at.soft{fill:#f2b134}.map .at.unlike{fill:#58a6ff}
.map a:hover .at{stroke-width:4}
.map rect.back{fill:#3b4247}
.legend i{display:inline-block;width:12px;height:12px;margin-right:6px;border:1px solid #0005;vertical-align:-1px}
.photos{display:grid;grid-template-columns:repeat(auto-fill,minmax(150px,1fr));gap:12px}
.photos figure{scroll-margin-top:20px}.photos figure:target{outline:4px solid var(--main);outline-offset:3px}
.photos img{border-radius:4px}.photos figcaption{overflow-wrap:anywhere}
.photos .bad{color:var(--warn);font-weight:600}
</style>"""


def look_page(survey: Survey, findings: Sequence[Finding], costs: Mapping[str, Cost]) -> str:
    """Return the page."""
    worst = findings[0].weight if findings else "none"
    title = f"First look: {'/'.join(survey.folder.parts[-2:]).lstrip('/')}"
    top = tag("div", tag("h1", escape(title)) + _badge(worst), class_="top")
    parts = [top, tag("p", tag("b", escape(verdict_of(findings)))), _facts(survey)]
    parts += [_finding(one) for one in findings]
    if survey.ground is not None:
        parts += [tag("h2", "Where, and how often each place is seen"), _map(survey, survey.ground)]
    parts += [tag("h2", "Along the flight"), _charts(survey)]
    if costs:
        parts += [tag("h2", "What aug3d will take on this machine"), _costs(survey, costs)]
    parts += [tag("h2", "Photographs, in the order of capture"), _pictures(survey)]
    return page(title, "".join(parts), head=_STYLE)


def _badge(weight: str) -> str:
    kind, word = _WORDS[weight]
    return tag("span", word, class_=f"badge {kind}")


def _facts(survey: Survey) -> str:
    sizes = sorted({photo.original_size for photo in survey.photos})
    times = [photo.exif.time for photo in survey.photos if photo.exif.time]
    facts = [("photographs", f"{len(survey.photos):,}"), ("size", ", ".join(f"{w} x {h} px" for w, h in sizes[:3]))]
    if times:
        first, last = min(times), max(times)
        day = "" if first.date() == last.date() else f"{last:%Y-%m-%d} "
        facts.append(("taken", f"{first:%Y-%m-%d %H:%M} to {day}{last:%H:%M}"))
    if survey.ground is not None:
        ground = survey.ground
        facts.append(("with a position", f"{np.isfinite(ground.enu_m[:, 0]).sum():,}"))
        if ground.height_from:
            facts.append(("height above ground", f"{np.nanmedian(ground.height_m):.0f} m, by {ground.height_from}"))
        if np.isfinite(ground.width_m):
            facts.append(("ground across a picture", f"{ground.width_m:.0f} m"))
        if ground.inside.any():
            facts.append(("ground flown", f"{ground.inside.sum() * ground.cell_m**2 / 1e4:.2g} ha"))
    overlaps = survey.overlaps[survey.overlaps > 0]
    if len(overlaps):
        none = f"; none in {survey.lost.sum()} of {len(survey.lost)}" if survey.lost.any() else ""
        facts.append(("overlap of neighbours", f"{np.median(overlaps):.0%}{none}"))
    return tag(
        "div", "".join(tag("span", f"{name} {tag('b', escape(value))}") for name, value in facts), class_="facts"
    )


def _finding(one: Finding) -> str:
    parts = [_badge(one.weight), tag("p", tag("b", escape(one.what))), tag("p", escape(one.to_do), class_="do")]
    if one.names:
        names = ", ".join(map(escape, one.names))
        some = ", ".join(map(escape, one.names[:_NAMED]))
        if len(one.names) > _NAMED:
            parts.append(tag("details", tag("summary", f"{some} and {len(one.names) - _NAMED} more") + tag("p", names)))
        else:
            parts.append(tag("p", names, class_="dim"))
    return tag("div", "".join(parts), class_=f"finding {_WORDS[one.weight][0]}")


def _map(survey: Survey, ground: Ground) -> str:
    at = ground.enu_m[:, :2]
    placed = ground.placed
    low, high = at[placed].min(axis=0), at[placed].max(axis=0)
    if ground.inside.any():
        low = np.minimum(low, ground.low_m)
        high = np.maximum(high, ground.low_m + np.array(ground.seen.shape[::-1]) * ground.cell_m)
    pad = 0.02 * float((high - low).max()) or 1.0
    frame = Frame(low - pad, high + pad, 1.0).scaled(_MAP_PX)
    drawn = f'<rect class="back" width="{frame.size[0]}" height="{frame.size[1]}"/>' + _seen(ground, frame)
    order = np.flatnonzero(placed)
    drawn += lines(frame, at[order[:-1]], at[order[1:]], "flown")
    soft, unlike = blurred(survey), exposed_unlike(survey)
    shown = _shown(soft | unlike | ground.wild)
    radius = max(_LEAST_RADIUS_PX, min(9.0, 200 / max(len(order), 1)))
    for photo in order:
        x, y = frame.place(at[photo])
        kind = "soft" if soft[photo] else "unlike" if unlike[photo] else ""
        circle = f'<circle class="at {kind}" cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}">'
        circle += tag("title", escape(_said(survey, ground, photo))) + "</circle>"
        drawn += f'<a href="#p{photo}">{circle}</a>' if shown[photo] else circle
    drawn = svg(*frame.size, f"Map of {placed.sum()} photographs", drawn + scale_bar(frame, "m"))
    return tag("div", drawn + _legend() + tag("p", _MAP_SAYS, class_="dim"), class_="card map")


def _said(survey: Survey, ground: Ground, photo: int) -> str:
    height = f", {ground.height_m[photo]:.0f} m high" if np.isfinite(ground.height_m[photo]) else ""
    return f"{survey.photos[photo].name}{height}"


def _seen(ground: Ground, frame: Frame) -> str:
    """Return how many photographs see each place, as colours; pale beyond what the flight encloses."""
    if not ground.inside.any():
        return ""
    rgba = np.zeros((*ground.seen.shape, 4), np.uint8)
    for least, colour in _SEEN:
        rgba[ground.seen >= least, :3] = colour
    rgba[..., 3] = np.where(ground.inside, _ALPHA_INSIDE, np.where(ground.seen > 0, _ALPHA_OUTSIDE, 0))
    return cells(frame, ground.low_m - ground.cell_m / 2, ground.cell_m, rgba)


def _legend() -> str:
    ends = [least - 1 for least, _ in _SEEN[1:]]
    words = [f"{least} to {end}" for (least, _), end in zip(_SEEN, ends, strict=False)] + [f"{_SEEN[-1][0]} or more"]
    colours = [colour for _, colour in _SEEN]
    keys = "".join(
        tag("span", f'<i style="background:rgb{colour}"></i>seen by {word}')
        for word, colour in zip(words, colours, strict=True)
    )
    for colour, word in (("#fff", "photograph"), ("#f2b134", "blurred"), ("#58a6ff", "exposed unlike its neighbours")):
        keys += tag("span", f'<i style="background:{colour};border-radius:50%"></i>{word}')
    return tag("div", keys, class_="legend")


def _charts(survey: Survey) -> str:
    series = [("Sharpness", [photo.sharpness for photo in survey.photos])]
    series.append(("Brightness [share of white]", [photo.brightness for photo in survey.photos]))
    series.append(("Overlap with the next [share]", list(survey.overlaps)))
    if survey.ground is not None and np.isfinite(survey.ground.enu_m[:, 2]).any():
        series.append(("Height by GPS, about the median [m]", list(survey.ground.enu_m[:, 2])))
    drawn = "".join(
        tag(
            "div",
            tag("h3", escape(name)) + curve(list(enumerate(map(float, values), 1)), name, "photograph"),
            class_="card",
        )
        for name, values in series
    )
    return tag("div", drawn, class_="curves")


def _costs(survey: Survey, costs: Mapping[str, Cost]) -> str:
    rows = [
        (
            escape(preset),
            f"{_about(cost.seconds.likely)} ({_about(cost.seconds.low)} to {_about(cost.seconds.high)})",
            f"{cost.peak_mib.likely / 1024:.1f} GiB",
            f"{cost.disk_mib.likely / 1024:.1f} GiB",
        )
        for preset, cost in costs.items()
    ]
    command = f"aug3d run NAME --photos {quote(str(survey.folder))} --dry-run"
    return table(("preset", "time", "memory", "disk"), rows, (1, 2, 3)) + tag(
        "p", f"Stage by stage: {tag('code', escape(command))}", class_="dim"
    )


def _about(seconds: float) -> str:
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.0f} h"


def _pictures(survey: Survey) -> str:
    soft, unlike = blurred(survey), exposed_unlike(survey)
    wild = survey.ground.wild if survey.ground is not None else np.zeros(len(survey.photos), bool)
    marked = soft | unlike | wild
    shown = _shown(marked)
    figures = []
    for i in np.flatnonzero(shown):
        photo = survey.photos[i]
        says = [word for word, so in (("blurred", soft[i]), ("exposure", unlike[i]), ("position", wild[i])) if so]
        source = data_uri("image/jpeg", photo.thumbnail)
        width, height = photo.original_size
        image = f'<img src="{source}" alt="{escape(photo.name)}" style="aspect-ratio:{width}/{height}">'
        caption = escape(photo.name) + (f" {tag('span', ', '.join(says), class_='bad')}" if says else "")
        figures.append(tag("figure", image + tag("figcaption", caption), id=f"p{i}"))
    left = int((~shown).sum())
    told = (
        tag("p", f"Of {number(left)} more, with which nothing is wrong, no picture is shown.", class_="dim")
        if left
        else ""
    )
    return tag("div", "".join(figures), class_="photos") + told


def _shown(marked: Bool[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Return which photographs are shown: all that are marked, and some of the others, evenly."""
    others = np.flatnonzero(~marked)
    shown = marked.copy()
    shown[others[:: max(-(-len(others) // _MOST_PICTURES), 1)]] = True
    return shown
