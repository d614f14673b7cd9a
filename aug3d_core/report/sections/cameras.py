"""Which photographs have a pose, and how well they fit: reprojection and GPS errors per photograph."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape

import numpy as np
import pandas as pd

from aug3d_core.photos.files import REDUNDANT, REJECTED_TABLE
from aug3d_core.report.histogram import histogram
from aug3d_core.report.html import number, table, tag
from aug3d_core.report.reported_run import ReportedRun
from aug3d_core.report.sections.control import control_points, surveyed
from aug3d_core.report.sections.gps import gps_errors
from aug3d_core.run.stage import Metric
from aug3d_core.sfm.files import MATCHING_TABLE, UNPLACED
from aug3d_core.split.files import SPLIT_TABLE

_MOST_ROWS = 500


def cameras(run: ReportedRun) -> str:
    """Return how the photographs were used."""
    sheet = run.pictures("photos") or run.pictures("town")
    shown = tag("details", tag("summary", "The photographs") + tag("div", sheet, class_="card")) if sheet else ""
    return _placed(run) + _left_out(run) + control_points(run) + _errors(run) + _each(run) + shown


def _placed(run: ReportedRun) -> str:
    """Say how many photographs were read, and how many have a pose."""
    photos, placed = run.record("photos"), run.record("sfm")
    if photos is None:
        return ""
    read, refused = photos.metrics.get("photos"), photos.metrics.get("rejected")
    said = [f"{tag('b', number(read))} photographs read, {number(refused)} refused."]
    if placed is not None:
        registered = tag("b", f"{number(placed.metrics['registered'])} of {number(placed.metrics['photos'])}")
        said.append(
            f"{registered} have a pose: {number(placed.metrics['points'])} points,"
            f" {number(placed.metrics['observations'])} observations,"
            f" {number(placed.metrics['reprojection_px'], 3)} px mean reprojection error."
        )
        said += _shutter(placed.metrics)
    return tag("p", " ".join(said))


def _shutter(metrics: Mapping[str, Metric]) -> Iterator[str]:
    """Say how far the camera flew on while it read a photograph; nothing of runs that did not measure it."""
    word, low_px, high_px = (metrics.get(f"rolling_shutter{name}") for name in ("", "_low_px", "_high_px"))
    if word is None:
        return
    if low_px is None:
        yield "Rolling shutter: cannot be told, for too few photographs were taken in straight flight."
        return
    interval = f"{number(low_px, 2)} to {number(high_px, 2)} px from the first row to the last (99 % interval)"
    readout_ms = metrics.get("readout_ms")
    read = f", rows read in {number(readout_ms, 2)} ms" if readout_ms else ""
    why = "; lines that cross would tell" if word == "cannot be told" else ""
    yield f"Rolling shutter: {word}, {interval}{read}{why}."


def _left_out(run: ReportedRun) -> str:
    """Return a row per photograph without a pose, with the likely reason."""
    refused, unplaced = run.table("photos", REJECTED_TABLE), run.table("sfm", UNPLACED)
    redundant = refused["reason"].str.startswith(REDUNDANT) if len(refused) else pd.Series(dtype=bool)
    rows = [
        (escape(row["name"]), "not needed" if spare else "not read", escape(row["reason"]), "-", "-")
        for row, spare in zip(refused.to_dict("records"), redundant, strict=True)
    ]
    rows += [
        (
            escape(row["name"]),
            "no pose",
            escape(row["reason"]),
            *(number(row.get(name)) for name in ("features", "matched_pairs")),
        )
        for row in unplaced.to_dict("records")
    ]
    if not rows:
        return tag("p", "No photograph was left out.", class_="dim") if run.record("sfm") else ""
    said = f"{(~redundant).sum()} could not be read, {len(unplaced)} have no pose; with the likely reason."
    if redundant.any():
        said += f" {redundant.sum()} show the same as the photograph before."
    heads = ("photograph", "state", "reason", "features", "matched pairs")
    return tag("h3", "Left out") + tag("p", said, class_="dim") + table(heads, rows[:_MOST_ROWS], numeric=(3, 4))


def _errors(run: ReportedRun) -> str:
    """Return histograms of reprojection errors, and of distances between cameras and their GPS."""
    charts = []
    if run.points is not None and len(run.points.error_px):
        drawn = histogram(run.points.error_px, "mean reprojection error of a point [px]", "Points")
        said = f"{len(run.points.error_px):,} points; mean {run.points.error_px.mean():.3f} px"
        charts.append(("Reprojection error", said, drawn))
    errors = gps_errors(run)
    located = errors[np.isfinite(errors[:, 0])] if len(errors) else errors
    if len(located):
        drawn = histogram(np.linalg.norm(located[:, :2], axis=1), "horizontal distance to GPS [m]", "Photographs")
        charts.append(("GPS error", _by_axis(located), drawn))
    elif run.views is not None and surveyed(run).empty:
        said = "GPS was not used: there is none, or it contradicts the photographs. Lengths are nominal."
        charts.append(("GPS error", said, ""))
    cards = (
        tag("div", tag("h3", name) + tag("p", said, class_="dim") + drawn, class_="card")
        for name, said, drawn in charts
    )
    return tag("div", "".join(cards), class_="curves") if charts else ""


def _by_axis(errors: np.ndarray) -> str:
    """Return the RMS error along each axis, as text."""
    rms = (
        np.sqrt(np.nanmean(errors**2, axis=0))
        if np.isfinite(errors[:, 2]).any()
        else np.sqrt(np.mean(errors[:, :2] ** 2, axis=0))
    )
    along = ", ".join(f"{axis} {value:.2f}" for axis, value in zip(("east", "north", "up"), rms, strict=False))
    return f"{len(errors)} photographs with GPS; RMS error [m]: {along}"


def _each(run: ReportedRun) -> str:
    """Return a row per photograph with a pose, worst fit first."""
    views, tracks, points = run.views, run.tracks, run.points
    if views is None or tracks is None or points is None:
        return ""
    count = np.bincount(tracks.view, minlength=len(views))
    error_px = np.bincount(tracks.view, points.error_px[tracks.point], len(views)) / np.maximum(count, 1)
    split = run.table("grouping", SPLIT_TABLE)
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
    heads = ("photograph", "role", "points seen", "mean error [px]", "GPS error [m]", "matched pairs")
    more = f", the {_MOST_ROWS} with the worst fit" if len(views) > _MOST_ROWS else ", worst fit first"
    return tag(
        "details", tag("summary", f"All photographs with a pose{more}") + table(heads, rows, numeric=range(2, 6))
    )


def _pairs_of(run: ReportedRun) -> dict[int, int]:
    """Return the number of matched photographs by photo id."""
    matching: pd.DataFrame = run.table("matching", MATCHING_TABLE)
    return dict(zip(matching["photo_id"], map(int, matching["matched_pairs"]), strict=True)) if len(matching) else {}
