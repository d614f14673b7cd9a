"""The layers of the map: ground, lines, domes, GPS errors, control points, scale bar."""

from __future__ import annotations

from html import escape

import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image

from aug3d_core.domes.files import CAMERAS, DOME_TABLE
from aug3d_core.report.html import tag
from aug3d_core.report.reported_run import ReportedRun
from aug3d_core.report.sections.control import surveyed
from aug3d_core.report.sections.gps import gps_errors
from aug3d_core.report.svg import raster, text
from aug3d_core.report.top_view import Frame, from_above

_GROUND_PX = (100, 700)
_GPS_SHOWN = 0.04  # length of the median GPS error, as a share of the map's width


def ground(run: ReportedRun, frame: Frame) -> str:
    """Return the picture of the ground under the map."""
    xyz, rgb = run.ground
    if not len(xyz):
        return ""
    # About as many pixels as points, so that few are empty
    fine = frame.scaled(int(np.clip(np.sqrt(len(xyz)), *_GROUND_PX)))
    return raster(frame.size, Image.fromarray(from_above(xyz, rgb, fine)[0]), "WEBP", quality=72)


def cells(frame: Frame, low: Float[np.ndarray, " 2"], cell: float, rgba: UInt8[np.ndarray, "y x 4"]) -> str:
    """Draw square cells, [north, east] from the south-west corner `low`, whose side is `cell` in the world."""
    rows, columns = rgba.shape[:2]
    picture = raster((columns, rows), Image.fromarray(rgba[::-1]), "PNG")
    (left, bottom), scale = frame.place(low), cell * frame.px
    return f'<g transform="translate({left:.1f} {bottom - rows * scale:.1f}) scale({scale:.5f})">{picture}</g>'


def lines(frame: Frame, start: Float[np.ndarray, "n 2"], end: Float[np.ndarray, "n 2"], kind: str) -> str:
    """Draw a line for each pair of places that are both known."""
    known = np.isfinite(start).all(axis=1) & np.isfinite(end).all(axis=1)
    pairs = np.concatenate([frame.place(start[known]), frame.place(end[known])], axis=1)
    return (
        f'<path class="{kind}" d="{"".join("M{:.1f} {:.1f}L{:.1f} {:.1f}".format(*p) for p in pairs)}"/>'
        if len(pairs)
        else ""
    )


def domes(run: ReportedRun, frame: Frame) -> str:
    """Draw each dome's square, centre and cameras; a cross where a place was rejected."""
    table, path = run.table("sampling", DOME_TABLE), run.file("sampling", CAMERAS)
    if table.empty or path is None:
        return ""
    parts = []
    for dome in table.to_dict("records"):
        x, y = frame.place(np.array([dome["x"], dome["y"]]))
        stands, half = dome["views"] > 0, dome["cell"] / 2 * frame.px
        said = f"dome {dome['dome_id']}: {dome['views']} views" if stands else f"no dome: {dome['why']}"
        title = f"<title>{escape(said)}</title>"
        if stands:
            box = f'x="{x - half:.1f}" y="{y - half:.1f}" width="{2 * half:.1f}" height="{2 * half:.1f}"'
            parts.append(f'<rect class="cell" {box}/><circle class="dome" cx="{x:.1f}" cy="{y:.1f}">{title}</circle>')
        else:
            parts.append(f'<path class="passed" d="M{x - 6:.1f} {y - 6:.1f}l12 12m-12 0l12 -12">{title}</path>')
    with np.load(path, allow_pickle=False) as cameras:
        at = cameras["world_from_cam"][:, :2, 3]
    dots = "".join("M{:.1f} {:.1f}h0".format(*place) for place in frame.place(at))
    return f'<path class="virtual" d="{dots}"/>' + "".join(parts)


def gps_lines(run: ReportedRun, frame: Frame, at: Float[np.ndarray, "n 3"]) -> tuple[str, str]:
    """Return the layer's name, and a line from each camera towards its GPS position, lengthened to be visible."""
    errors = gps_errors(run)
    known = np.isfinite(errors[:, 0]) if len(errors) else np.zeros(0, bool)
    if not known.any():
        return "", ""
    median = float(np.median(np.linalg.norm(errors[known, :2], axis=1)))
    wanted = _GPS_SHOWN * float((frame.high - frame.low).max()) / max(median, 1e-9)
    times = float(f"{max(wanted, 1):.1g}")
    gps = at[known, :2] - times * errors[known, :2]
    return f"GPS errors, {times:g} times as long", lines(frame, at[known, :2], gps, "gps-error")


def control(run: ReportedRun, frame: Frame) -> str:
    """Draw a triangle at each control point, hollow where it only judges or is wrong."""
    drawn = []
    for point in surveyed(run).to_dict("records"):
        x, y = frame.place(np.array([point["x_m"], point["y_m"]]))
        off = " ".join(f"{axis} {point[f'error_{axis}_m']:+.2f}" for axis in ("east", "north", "up"))
        title = tag("title", escape(f"{point['point']} ({point['role']}): {off} m"))
        drawn.append(tag("path", title, class_=f"point {point['role']}", d=f"M{x:.1f} {y - 9:.1f}l8 14h-16z"))
    return "".join(drawn)


def scale_bar(frame: Frame, unit: str) -> str:
    """Draw a scale bar of about a fifth of the map."""
    wanted = 0.2 * float((frame.high - frame.low).max())
    power = 10.0 ** np.floor(np.log10(wanted))
    length = power * max(m for m in (1, 2, 5) if m * power <= wanted)
    said, bottom = f"{length:g} {unit if unit == 'm' else f'{unit}s'}", frame.size[1] - 18
    wide = max(length * frame.px, 17.0 * len(said)) + 24
    back = f'<rect class="scale-back" x="8" y="{bottom - 54}" width="{wide:.0f}" height="64" rx="6"/>'
    bar = f'<path class="scale" d="M20 {bottom}v-8v8h{length * frame.px:.1f}v-8"/>'
    return back + bar + text(20, bottom - 30, said, "start", "scale-text")
