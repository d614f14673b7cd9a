"""A list of ground control points, held against the photographs before any of them is processed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from aug3d_core.look.glance import Glance
from aug3d_core.run.errors import InputError

LEAST_MARKS = 2  # photographs that have to show a point


@dataclass(frozen=True)
class Listed:
    """control, check: how many points are marked often enough. problem, remedy: why the list cannot be read."""

    control: int = 0
    check: int = 0
    problem: str = ""
    remedy: str = ""
    notes: tuple[str, ...] = ()


def listed_points(file: Path, photos: Sequence[Glance]) -> Listed:
    """Read a list as the photos stage will."""
    from aug3d_core.photos.control import read_control  # with GDAL, which most folders do without

    sizes = pd.DataFrame([photo.original_size for photo in photos], columns=["width_px", "height_px"])
    table = sizes.assign(
        photo_id=range(len(photos)),
        name=[photo.name for photo in photos],
        original_width_px=sizes["width_px"],
        original_height_px=sizes["height_px"],
        lat_deg=[photo.exif.lat_deg for photo in photos],
        lon_deg=[photo.exif.lon_deg for photo in photos],
    )
    try:
        marks, notes = read_control(file, table)
    except InputError as error:
        return Listed(problem=error.problem, remedy=error.remedy)
    points = marks.groupby("point")["check"].agg(["size", "first"])
    often = points.loc[points["size"] >= LEAST_MARKS, "first"].astype(bool)
    return Listed(int((~often).sum()), int(often.sum()), notes=notes)
