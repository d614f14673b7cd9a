"""The photo table: one row per accepted photograph, in capture order."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from aug3d_core.photos.decode import Decoded
from aug3d_core.store import layout


def photo_table(photos: Sequence[Decoded]) -> pd.DataFrame:
    """Build the table; row i is photo i. `focal_px` is at the working copy's size, NaN if unknown."""
    rows = [
        {
            "photo_id": photo_id,
            "name": photo.name,
            "file": f"{layout.PHOTO_IMAGES}/{layout.image_name(photo_id)}",
            "width_px": photo.size[0],
            "height_px": photo.size[1],
            "original_width_px": photo.original_size[0],
            "original_height_px": photo.original_size[1],
            "focal_px": photo.exif.focal_px * max(photo.size) / max(photo.original_size),
            "focal_source": photo.exif.focal_source,
            "camera": photo.exif.camera,
            "lat_deg": photo.exif.lat_deg,
            "lon_deg": photo.exif.lon_deg,
            "alt_m": photo.exif.alt_m,
            "time": photo.exif.time,
            "orientation": photo.exif.orientation,
            "sharpness": photo.sharpness,
            "sha256": photo.sha256,
        }
        for photo_id, photo in enumerate(photos)
    ]
    table = pd.DataFrame(rows)
    return table.assign(time=pd.to_datetime(table["time"]).astype("datetime64[ms]"))


def rejected_table(rejected: Sequence[tuple[str, str]]) -> pd.DataFrame:
    """Build the table of (name, reason)."""
    return pd.DataFrame(sorted(rejected), columns=["name", "reason"], dtype="str")


def read_photos(folder: Path) -> pd.DataFrame:
    """Read the photo table from the photos stage's output."""
    return pd.read_parquet(folder / layout.PHOTO_TABLE)
