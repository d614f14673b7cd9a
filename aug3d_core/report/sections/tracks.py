"""Overlap: photographs per point, and photographs per piece of ground."""

from __future__ import annotations

from html import escape
from itertools import pairwise

import numpy as np
from PIL import Image

from aug3d_core.geometry.transforms import centres
from aug3d_core.report.histogram import count_histogram
from aug3d_core.report.html import percent, tag
from aug3d_core.report.reported_run import ReportedRun
from aug3d_core.report.svg import raster, svg

ENOUGH = 5  # photographs of a place; surveyors call that good overlap
_LONGEST = 12  # tracks of this length or more are one bar
_STEPS = ((1, "#b3362b"), (2, "#e0813a"), (3, "#ecc94b"), (5, "#9bcb5a"), (10, "#3f9b63"), (20, "#1d6f8b"))


def tracks(run: ReportedRun) -> str:
    """Return the histogram of track lengths beside the map of overlap."""
    cards = _lengths(run) + _overlap_map(run)
    return tag("div", cards, class_="curves") if cards else ""


def _lengths(run: ReportedRun) -> str:
    if run.tracks is None:
        return ""
    seen = np.bincount(run.tracks.point)
    seen = seen[seen > 0]
    counts = np.bincount(np.minimum(seen, _LONGEST), minlength=_LONGEST + 1).tolist()
    drawn = count_histogram(dict(enumerate(counts[2:], 2)), "photographs that see a point", "Points")
    said = f"{len(seen):,} points; a point is seen by {seen.mean():.2f} photographs on average, median {np.median(seen):.0f}."
    return tag("div", tag("h3", "Track lengths") + tag("p", said, class_="dim") + drawn, class_="card")


def _overlap_map(run: ReportedRun) -> str:
    seen, frame, views = run.seen_by, run.frame, run.views
    if seen is None or frame is None or views is None or not (seen >= 0).any():
        return ""
    colours = np.zeros((*seen.shape, 4), np.uint8)
    for least, colour in _STEPS:
        colours[seen >= least] = (*bytes.fromhex(colour[1:]), 255)
    at = frame.place(centres(views.cam_from_world)[:, :2])
    dots = "".join("M{:.1f} {:.1f}h0".format(*place) for place in at)
    drawn = raster(frame.size, Image.fromarray(colours), "PNG") + f'<path class="virtual" d="{dots}"/>'
    ground = seen[seen >= 0]
    share, half = percent(float(np.mean(ground >= ENOUGH))), np.median(ground)
    said = f"{share} of the mapped surface is in {ENOUGH} or more photographs; median {half:.0f} photographs."
    note = "A photograph counts if the place lies within its frame; occlusion is ignored."
    chart = tag("div", svg(*frame.size, "Photographs that see each piece of ground", drawn), class_="map")
    head = tag("h3", "Overlap") + tag("p", said, class_="dim")
    return tag("div", head + chart + _key() + tag("p", note, class_="dim"), class_="card")


def _key() -> str:
    """Return the colour key."""
    names = [f"{low}-{high - 1}" if high > low + 1 else str(low) for (low, _), (high, _) in pairwise(_STEPS)]
    names.append(f"{_STEPS[-1][0]} or more photographs")
    keys = (
        tag("span", f'<i class="key" style="background:{colour}"></i>{escape(name)}')
        for name, (_, colour) in zip(names, _STEPS, strict=True)
    )
    return tag("div", "".join(keys), class_="legend")
