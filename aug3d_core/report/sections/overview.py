"""The map: the scene from above, cameras coloured by group, domes, and GPS errors."""

from __future__ import annotations

import json
from html import escape

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Views
from aug3d_core.groups.files import GROUPS
from aug3d_core.report.html import number, tag
from aug3d_core.report.reported_run import ReportedRun
from aug3d_core.report.sections.control import surveyed
from aug3d_core.report.sections.map_layers import control, domes, gps_lines, ground, lines, scale_bar
from aug3d_core.report.svg import svg
from aug3d_core.report.top_view import Frame
from aug3d_core.split.files import SPLIT_TABLE

_MOST_CAMERAS = 2000  # above this, only every n-th is drawn
_AT_FIRST_HIDDEN = ("gps", "domes", "looks")
_NO_ROLE = "placed"
_MOST_MEMBERS = 20_000
_COLOURS = 10  # of groups, in the style sheet
_RADIUS_PX = (7.0, 10.0)
_FOR_SIZE = 200  # cameras that the typical distance is computed from


def overview(run: ReportedRun) -> str:
    """Return the map with its legend; checkboxes show and hide its layers."""
    views, frame = run.views, run.frame
    if views is None or frame is None:
        return ""
    at = centres(views.cam_from_world)
    roles, look = _roles(run, len(views))
    shown = np.arange(0, len(views), -(-len(views) // _MOST_CAMERAS))
    colours, groups = _group_colours(run, len(views))
    layers = [
        ("ground", "ground", ground(run, frame)),
        ("looks", "viewing directions", lines(frame, at[shown, :2], look[shown], "look")),
        ("domes", "domes and virtual views", domes(run, frame)),
        ("gps", *gps_lines(run, frame, at)),
        ("cams", "cameras", "".join(_camera(run, views, frame, at, roles, colours, view) for view in shown)),
        ("control", "control points", control(run, frame)),
    ]
    size = f"--r:{_radius_px(frame.place(at[:, :2])):.1f}px"
    drawn = "".join(f'<g class="{key}" style="{size}">{content}</g>' for key, _, content in layers)
    drawing = svg(*frame.size, f"Map of {len(views)} cameras", drawn + scale_bar(frame, run.unit))
    boxes = "".join(
        f'<label><input type="checkbox" class="show-{key}"{"" if key in _AT_FIRST_HIDDEN else " checked"}>{name}</label>'
        for key, name, content in layers
        if content
    )
    chart = tag("div", drawing, class_="drawing", data_groups=_members(run))
    return tag("div", tag("div", boxes, class_="layers") + chart + _legend(run, roles, groups), class_="card map")


def _roles(run: ReportedRun, count: int) -> tuple[np.ndarray, Float[np.ndarray, "n 2"]]:
    """Return each view's role (empty if none) and the place it looks at (NaN if unknown)."""
    table = run.table("grouping", SPLIT_TABLE)
    role, look = np.full(count, "", dtype=object), np.full((count, 2), np.nan)
    if len(table):
        role[table["view"]] = table["role"].astype(str)
        look[table["view"]] = table[["look_x", "look_y"]]
    return role, look


def _group_colours(run: ReportedRun, count: int) -> tuple[Int[np.ndarray, " n"], int]:
    """Return a colour for each view (-1 without a group) and the number of coloured groups.

    Groups share views. A greedy cover is shown: always the group with the most views that have no colour yet.
    """
    colour, path = np.full(count, -1), run.file("grouping", GROUPS)
    if path is None:
        return colour, 0
    with np.load(path, allow_pickle=False) as arrays:
        members = arrays["members"]
    chosen = 0
    while len(members):
        gains = (colour[members] < 0).sum(axis=1)
        best = int(gains.argmax())
        if not gains[best]:
            break
        mine = members[best][colour[members[best]] < 0]
        colour[mine] = chosen
        chosen += 1
    return colour, chosen


def _members(run: ReportedRun) -> str:
    """Return the views of each group as JSON for the script; none if they would make the page too large."""
    path = run.file("grouping", GROUPS)
    if path is None:
        return "[]"
    with np.load(path, allow_pickle=False) as arrays:
        members = arrays["members"]
    return json.dumps(members.tolist() if members.size <= _MOST_MEMBERS else [], separators=(",", ":"))


def _camera(
    run: ReportedRun,
    views: Views,
    frame: Frame,
    at: Float[np.ndarray, "n 3"],
    roles: np.ndarray,
    colours: Int[np.ndarray, " n"],
    view: int,
) -> str:
    x, y = frame.place(at[view, :2])
    role = roles[view] or _NO_ROLE
    kind = f"g{colours[view] % _COLOURS}" if role == "train" and colours[view] >= 0 else ""
    name = escape(f"{run.called(int(views.photo_id[view]))}: {role}")
    place = f'data-view="{view}" cx="{x:.1f}" cy="{y:.1f}"'
    return f'<circle class="cam {escape(role)} {kind}" {place}><title>{name}</title></circle>'


def _radius_px(places: Float[np.ndarray, "n 2"]) -> float:
    """Return the radius of a camera's mark: smaller if cameras are close together."""
    some = places[:: -(-len(places) // _FOR_SIZE)]
    apart = np.linalg.norm(some[:, None] - places, axis=-1)
    apart[apart == 0] = np.inf
    nearest = apart.min(axis=1)
    return float(np.clip(0.5 * np.median(nearest), *_RADIUS_PX)) if np.isfinite(nearest).any() else _RADIUS_PX[1]


def _legend(run: ReportedRun, roles: np.ndarray, coloured: int) -> str:
    """Return the legend."""
    groups = number(run.metric("grouping", "groups"))
    said = {
        "train": f"training; colours show {coloured} of {groups} groups, which contain all of them",
        "spare": "spare: left out, as enough others show the same",
        "gap": "gap: used neither for training nor for the test",
        "support": "support: input photographs of the test",
        "target": "target: held out and predicted in the test",
        "": "pose known, no role",
    }
    names, counts = np.unique(roles.astype(str), return_counts=True)
    found = dict(zip(names.tolist(), counts.tolist(), strict=True))
    entries = "".join(
        tag("span", f'<i class="key {role or _NO_ROLE}"></i>{found[role]} {meant}')
        for role, meant in said.items()
        if role in found
    )
    points = surveyed(run)
    if len(points):
        entries += tag("span", '<i class="key point-key"></i>control point; dark: only judges, or wrong')
    facing = "North is up." if run.unit == "m" else "No GPS: the map's orientation and scale are nominal."
    use = "Point at a mark for the photograph's name. Click it to show a group with this photograph, again for the next group."
    return tag("div", entries, class_="legend") + tag("p", f"{facing} {use}", class_="dim")
