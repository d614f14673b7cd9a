"""The advice on a map, as one HTML file that needs no network."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from urllib.parse import quote

import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image
from scipy.ndimage import distance_transform_edt

from aug3d_core.advice.choice import HIGHER, Advised
from aug3d_core.advice.need import POOR
from aug3d_core.advice.plan import Plan
from aug3d_core.advice.site import Site
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import centres
from aug3d_core.report.html import number, page, table, tag
from aug3d_core.report.sections.map_layers import cells, lines, scale_bar
from aug3d_core.report.svg import raster, svg, text
from aug3d_core.report.top_view import Frame

_MAP_PX, _GROUND_PX = 1100, 500
_WORST, _BEST = np.array([196, 50, 40]), np.array([46, 140, 80])  # colours of nothing seen, and of nothing missing
_ALPHA = 120
_DOT_PX, _HEADING_PX = 13.0, 32.0  # from the middle: also cameras that look straight down have a heading
_SPREAD_CELLS = 2.0  # so far a colour goes over cells without a sample of their own
_ALL = 0.995  # looked at: as percents are rounded
_LITTLE_M = 1.0  # higher than is lawful: the ground is not known better
_STYLE = """<style>
.map path.flown{stroke:#fff;stroke-width:2.5;opacity:.9;fill:none}.map .at{fill:#fff;opacity:.75}
.map rect.back{fill:#3b4247}.map .new{fill:#1f6feb;stroke:#fff;stroke-width:2}
.map .way{stroke:#1f6feb;stroke-width:5;fill:none}.map text.rank{fill:#fff;font-size:15px;font-weight:700}
.legend i{display:inline-block;width:12px;height:12px;margin-right:6px;border:1px solid #0005;vertical-align:-1px}
.legend i.dot{border-radius:50%}.map p{margin:6px 0 0}
</style>"""


def advice_page(scene: str, plan: Plan, mesh: Mesh, files: Sequence[str]) -> str:
    """Return the page. files: names of those written beside it."""
    before, after = plan.choice.missing[0], plan.choice.missing[-1]
    parts = [tag("h1", escape(f"What to photograph next: {scene}")), tag("p", tag("b", escape(verdict(plan))))]
    facts = [
        ("photographs now", number(len(plan.views))),
        ("to take", number(len(plan.choice.advised))),
        ("missing before, after", f"{before:.0%}, {after:.0%}"),
        ("flown at", f"{plan.site.height:.0f} {plan.unit} above the ground"),
        (
            "to be flown at",
            f"{plan.site.height_flown(HIGHER):.0f} {plan.unit} above the ground,"
            f" and {plan.site.margin:.0f} {plan.unit} above what is near",
        ),
        ("highest roof", f"{plan.site.roof - plan.lowest_ground:.0f} {plan.unit} above the lowest ground"),
    ]
    told = "".join(tag("span", f"{escape(name)} {tag('b', escape(value))}") for name, value in facts)
    parts.append(tag("div", told, class_="facts"))
    if said := caution(plan):
        parts.append(tag("p", tag("b", escape(said)), class_="note"))
    parts += [tag("h2", "What is missing now, and where to stand"), _map(plan, mesh, plan.choice.before, True)]
    if plan.choice.advised:
        parts += [tag("h2", "What is missing then"), _map(plan, mesh, plan.choice.after, False)]
        parts += [tag("h2", "The photographs, best first"), _table(plan)]
    if files:
        links = ", ".join(tag("a", tag("code", escape(name)), href=quote(name)) for name in files)
        parts += [tag("h2", "Files"), tag("p", links)]
    return page(f"Advice: {scene}", "".join(parts), head=_STYLE)


def verdict(plan: Plan) -> str:
    """Return the advice in a few words, and of how much of the site it is where that is not all."""
    before, after = plan.choice.missing[0], plan.choice.missing[-1]
    if (looked_at := plan.choice.looked_at) < _ALL:
        return f"{_verdict(plan, before, after, 'what was looked at')} {looked_at:.0%} of the site was looked at."
    return _verdict(plan, before, after, "the site")


def _verdict(plan: Plan, before: float, after: float, where: str) -> str:
    known = np.isfinite(plan.choice.before)
    hole, poor = float(plan.site.in_hole[known].mean()), float((plan.choice.before[known] > POOR).mean())
    if not plan.choice.advised:
        if before < 0.005:
            return "Nothing is missing: each place is photographed from wherever the flight looks."
        return f"{before:.0%} is missing of views like the flight's, but no photograph that may be taken would make up for it."
    holes = f", and the mesh has nothing of {hole:.0%}" if hole >= 0.005 else ""
    return (
        f"{poor:.0%} of {where} is poorly photographed{holes}. {len(plan.choice.advised)} more photographs would make up for"
        f" {1 - after / before:.0%} of what is missing."
    )


def caution(plan: Plan) -> str:
    """Return what whoever flies the mission must heed; empty where there is none."""
    if not plan.choice.advised:
        return ""
    said = list[str]()
    most = max(plan.site.lawful, plan.site.height) + _LITTLE_M
    if plan.origin is not None:
        where = (
            f"Do not take off below {plan.take_off_m:.0f} m, the lowest ground of the area (altitude as the photographs' GPS"
            " or the control points have it)"
            if plan.take_off_m is not None
            else "Do not take off below the lowest ground of the area; GPS told no altitudes, so nobody knows that of it"
        )
        said.append(
            f"{where}: the mission's heights are above the take-off point; from lower down it flies lower, from higher up"
            " higher."
        )
        if plan.clear_height > most:
            said.append(
                f"It comes and goes {plan.clear_height:.0f} m above the take-off point: {plan.site.margin:.0f} m above all"
                " that is known about."
            )
    if plan.above_ground > most:
        said.append(
            f"It takes the drone up to {plan.above_ground:.0f} m above the ground, which is more than is lawful without a"
            f" permit in most countries: over a valley, or to keep {plan.site.margin:.0f} m above what stands there."
        )
    return " ".join(said)


def why(one: Advised) -> str:
    """Say what a photograph is for."""
    reasons = []
    if one.hole >= 0.05:
        reasons.append(f"{one.hole:.0%} of what it shows is a hole of the mesh")
    if one.poor >= 0.05:
        reasons.append(f"{one.poor:.0%} is poorly photographed")
    if one.error >= 1.2:
        reasons.append(f"the model errs {one.error:.1f} times as much there as usual")
    return "; ".join(reasons) or "nearer to what views between the photographs show"


def _map(plan: Plan, mesh: Mesh, missing: Float[np.ndarray, " s"], with_advice: bool) -> str:
    site = plan.site
    wanted = site.area.middle(site.area.wanted)
    at = np.array([one.xyz[:2] for one in plan.choice.advised]).reshape(-1, 2)
    places = np.concatenate([wanted, at, centres(plan.views.cam_from_world)[:, :2]])
    low, high = places.min(axis=0), places.max(axis=0)
    pad = 0.03 * float((high - low).max())
    frame = Frame(low - pad, high + pad, 1.0).scaled(_MAP_PX)
    drawn = f'<rect class="back" width="{frame.size[0]}" height="{frame.size[1]}"/>'
    ground = _from_above(site, mesh, frame.scaled(_GROUND_PX))
    drawn += raster(frame.size, Image.fromarray(ground), "WEBP", quality=72) + _missing(site, frame, missing)
    for x, y in frame.place(centres(plan.views.cam_from_world)[:, :2]):
        drawn += f'<circle class="at" cx="{x:.1f}" cy="{y:.1f}" r="3.5"/>'
    if with_advice:
        drawn += lines(frame, at[:-1], at[1:], "flown")
        drawn += "".join(_mark(frame, one) for one in plan.choice.advised)
    drawn = svg(*frame.size, "Map of what is missing", drawn + scale_bar(frame, plan.unit))
    return tag("div", drawn + _legend(plan, with_advice), class_="card map")


def _from_above(site: Site, mesh: Mesh, frame: Frame) -> UInt8[np.ndarray, "h w 4"]:
    """Return the mesh as straight rays from above meet it, transparent where they miss."""
    width, height = frame.size
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    xy = frame.low + np.stack([column, height - row], axis=-1) / frame.px
    above = np.full((height, width, 1), float(mesh.xyz[:, 2].max()) + 1)
    hits = site.surface.cast(np.concatenate([xy, above], axis=-1), np.array([0.0, 0.0, -1.0]))
    hit = hits.triangle >= 0
    rgba = np.zeros((height, width, 4), np.uint8)
    rgba[hit, :3], rgba[hit, 3] = np.rint(mesh.colour_at(hits.triangle[hit], hits.weights[hit])).clip(0, 255), 255
    return rgba


def _missing(site: Site, frame: Frame, missing: Float[np.ndarray, " s"]) -> str:
    """Return what is missing as colours, cell by cell: the mean over its samples; a cell without any has its neighbour's.

    Where nothing near was looked at there is no colour.
    """
    area = site.area
    rows, columns = area.wanted.shape
    column, row = np.floor((site.samples.xyz[:, :2] - area.low) / area.cell).astype(int).T
    cell = row.clip(0, rows - 1) * columns + column.clip(0, columns - 1)
    known = np.isfinite(missing)
    count = np.bincount(cell[known], minlength=rows * columns)
    share = np.bincount(cell[known], 1 - missing[known], minlength=rows * columns) / np.maximum(count, 1)
    away, nearest = distance_transform_edt(count.reshape(rows, columns) == 0, return_indices=True)  # pyright: ignore
    share = share.reshape(rows, columns)[tuple(nearest)]
    rgba = np.zeros((rows, columns, 4), np.uint8)
    rgba[..., :3] = _WORST + share[..., None] * (_BEST - _WORST)
    rgba[..., 3] = np.where(area.wanted & (away <= _SPREAD_CELLS), _ALPHA, 0)
    return cells(frame, area.low, area.cell, rgba)


def _mark(frame: Frame, one: Advised) -> str:
    x, y = frame.place(np.array(one.xyz[:2]))
    yaw = np.radians(one.yaw_deg)
    right, down = _HEADING_PX * np.sin(yaw), -_HEADING_PX * np.cos(yaw)
    way = f'<path class="way" d="M{x:.1f} {y:.1f}l{right:.1f} {down:.1f}"/>'
    said = tag("title", escape(f"{one.rank}: {why(one)}"))
    dot = f'<circle class="new" cx="{x:.1f}" cy="{y:.1f}" r="{_DOT_PX}">{said}</circle>'
    return way + dot + text(x, y, str(one.rank), "middle", "rank")


def _legend(plan: Plan, with_advice: bool) -> str:
    keys = [(f"rgb{tuple(_WORST)}", "all is missing"), (f"rgb{tuple((_WORST + _BEST) // 2)}", "half of it")]
    keys += [(f"rgb{tuple(_BEST)}", "nothing: photographed from wherever the flight looks")]
    said = "".join(tag("span", f'<i style="background:{colour}"></i>{word}') for colour, word in keys)
    said += tag("span", "without colour: not looked at") if plan.choice.looked_at < _ALL else ""
    dots = [("#fff", "photographs")]
    dots += [("#1f6feb", "to take, with its rank; the blue line is its heading")] if with_advice else []
    said += "".join(tag("span", f'<i class="dot" style="background:{colour}"></i>{word}') for colour, word in dots)
    north = "North is up." if plan.origin is not None else "Nothing told where north is."
    way = " The white line is the way from one to the next." if with_advice and plan.choice.advised else ""
    return tag("div", said, class_="legend") + tag("p", north + way, class_="dim")


def _table(plan: Plan) -> str:
    rows = [
        (
            str(one.rank),
            ", ".join(f"{value:.1f}" for value in one.xyz[:2]), f"{one.xyz[2] - plan.lowest_ground:.1f}",
            f"{one.yaw_deg:.0f}", f"{one.pitch_deg:.0f}", f"{one.adds:.1%}", escape(why(one)),
        )
        for one in sorted(plan.choice.advised, key=lambda one: one.rank)
    ]  # fmt: skip
    heads = ("rank", f"x, y [{plan.unit}]", f"above the lowest ground [{plan.unit}]", "heading [deg]", "gimbal [deg]")
    return table((*heads, "adds", "why"), rows, (0, 2, 3, 4, 5))
