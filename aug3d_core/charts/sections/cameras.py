"""Which photographs have a place, and how well they fit: errors of pixels and of GPS, photograph by photograph."""

from __future__ import annotations

from html import escape

import numpy as np
import pandas as pd

from aug3d_core.charts.histogram import histogram
from aug3d_core.charts.html import number, table, tag
from aug3d_core.charts.sections.gps import gps_errors
from aug3d_core.charts.sections.run import Run
from aug3d_core.photos.table import REDUNDANT
from aug3d_core.store import layout

_MOST_ROWS = 500


def cameras(run: Run) -> str:
    """Return what became of the photographs."""
    sheet = run.pictures("photos") or run.pictures("town")
    shown = tag("details", tag("summary", "The photographs") + tag("div", sheet, class_="card")) if sheet else ""
    return _placed(run) + _left_out(run) + _errors(run) + _each(run) + shown


def _placed(run: Run) -> str:
    """Say how many photographs were read and placed."""
    photos, placed = run.record("photos"), run.record("sfm")
    if photos is None:
        return ""
    read, refused = photos.metrics.get("photos"), photos.metrics.get("rejected")
    said = [f"{tag('b', number(read))} photographs read, {number(refused)} refused."]
    if placed is not None:
        registered = tag("b", f"{number(placed.metrics['registered'])} of {number(placed.metrics['photos'])}")
        said.append(
            f"{registered} have a place in the model: {number(placed.metrics['points'])} points,"
            f" {number(placed.metrics['observations'])} observations,"
            f" {number(placed.metrics['reprojection_px'], 3)} px between points and pictures."
        )
    return tag("p", " ".join(said))


def _left_out(run: Run) -> str:
    """Return a row per photograph that has no place: which, and the likely reason."""
    refused, unplaced = run.table("photos", layout.REJECTED_TABLE), run.table("sfm", layout.UNPLACED)
    redundant = refused["reason"].str.startswith(REDUNDANT) if len(refused) else pd.Series(dtype=bool)
    rows = [
        (escape(row["name"]), "not needed" if spare else "not read", escape(row["reason"]), "-", "-")
        for row, spare in zip(refused.to_dict("records"), redundant, strict=True)
    ]
    rows += [
        (
            escape(row["name"]),
            "not placed",
            escape(row["reason"]),
            *(number(row.get(name)) for name in ("features", "matched_pairs")),
        )
        for row in unplaced.to_dict("records")
    ]
    if not rows:
        return tag("p", "No photograph was left out.", class_="dim") if run.record("sfm") else ""
    said = (
        f"{(~redundant).sum()} could not be read, {len(unplaced)} have no place in the model; with the likely reason."
    )
    if redundant.any():
        said += f" {redundant.sum()} show what the one before them shows."
    heads = ("photograph", "what", "why", "features", "matched pairs")
    return tag("h3", "Left out") + tag("p", said, class_="dim") + table(heads, rows[:_MOST_ROWS], numeric=(3, 4))


def _errors(run: Run) -> str:
    """Return histograms of the distances between points and pictures, and between cameras and their GPS."""
    charts = []
    if run.points is not None and len(run.points.error_px):
        drawn = histogram(run.points.error_px, "mean distance of a point (px)", "Points")
        said = f"{len(run.points.error_px):,} points; mean {run.points.error_px.mean():.3f} px"
        charts.append(("Reprojection error", said, drawn))
    errors = gps_errors(run)
    located = errors[np.isfinite(errors[:, 0])] if len(errors) else errors
    if len(located):
        drawn = histogram(np.linalg.norm(located[:, :2], axis=1), "horizontal distance to GPS (m)", "Photographs")
        charts.append(("GPS error", _by_axis(located), drawn))
    elif run.views is not None:
        said = "The positions of the photographs were not used: there is no GPS, or it contradicts them. Lengths are nominal."
        charts.append(("GPS error", said, ""))
    cards = (
        tag("div", tag("h3", name) + tag("p", said, class_="dim") + drawn, class_="card")
        for name, said, drawn in charts
    )
    return tag("div", "".join(cards), class_="curves") if charts else ""


def _by_axis(errors: np.ndarray) -> str:
    """Say how large the errors are along each axis."""
    rms = (
        np.sqrt(np.nanmean(errors**2, axis=0))
        if np.isfinite(errors[:, 2]).any()
        else np.sqrt(np.mean(errors[:, :2] ** 2, axis=0))
    )
    along = ", ".join(f"{axis} {value:.2f}" for axis, value in zip(("east", "north", "up"), rms, strict=False))
    return f"{len(errors)} photographs with GPS; root mean square in m: {along}"


def _each(run: Run) -> str:
    """Return a row per placed photograph, those that fit worst first."""
    views, tracks, points = run.views, run.tracks, run.points
    if views is None or tracks is None or points is None:
        return ""
    count = np.bincount(tracks.view, minlength=len(views))
    error_px = np.bincount(tracks.view, points.error_px[tracks.point], len(views)) / np.maximum(count, 1)
    split = run.table("grouping", layout.SPLIT_TABLE)
    role = dict(zip(split["view"], split["role"], strict=True)) if len(split) else {}
    errors = gps_errors(run)
    gps_m = np.linalg.norm(errors[:, :2], axis=1) if len(errors) else np.full(len(views), np.nan)
    matched = _pairs_of(run)
    rows = [
        (
            escape(run.called(int(views.photo_id[view]))),
            escape(role.get(view, "-")),
            number(int(count[view])),
            f"{error_px[view]:.3f}",
            f"{gps_m[view]:.2f}" if np.isfinite(gps_m[view]) else "-",
            number(matched.get(int(views.photo_id[view]))),
        )
        for view in np.argsort(-error_px, kind="stable")[:_MOST_ROWS]
    ]
    heads = ("photograph", "role", "points seen", "their error (px)", "GPS error (m)", "matched pairs")
    more = f", the {_MOST_ROWS} that fit worst" if len(views) > _MOST_ROWS else ", worst fit first"
    return tag("details", tag("summary", f"Every placed photograph{more}") + table(heads, rows, numeric=range(2, 6)))


def _pairs_of(run: Run) -> dict[int, int]:
    """Return the number of photographs that each one matched, by photo id."""
    matching: pd.DataFrame = run.table("matching", layout.MATCHING_TABLE)
    return dict(zip(matching["photo_id"], map(int, matching["matched_pairs"]), strict=True)) if len(matching) else {}
