"""The photo table: one row per accepted photograph, in capture order."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from jaxtyping import Float

from aug3d_core.photos.decode import Decoded
from aug3d_core.photos.files import PHOTO_IMAGES, image_name
from aug3d_core.run.errors import UsageError

_SAME_FOCAL = 0.02  # relatively: what a lens at rest may waver by


def photo_table(photos: Sequence[Decoded]) -> pd.DataFrame:
    """Build the table; row i is photo i. `focal_px` is at the working copy's size, NaN if unknown.

    Photographs of one `camera` share intrinsics.
    """
    rows = [
        {
            "photo_id": photo_id,
            "name": photo.name,
            "file": f"{PHOTO_IMAGES}/{image_name(photo_id)}",
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
    for camera, alike in table.groupby("camera").indices.items():
        table.loc[alike, "camera"] = _zoomed(str(camera), table["focal_px"].to_numpy()[alike])
    return table.assign(time=pd.to_datetime(table["time"]).astype("datetime64[ms]"))


def _zoomed(camera: str, focal_px: Float[np.ndarray, " n"]) -> list[str]:
    """Name the cameras of photographs that name the same one: digital zoom leaves the lens's millimetres as they are.

    One whose focal length is unknown may have any, and shares that of the others only where there is one.
    """
    steps: list[float] = []
    for focal in np.unique(focal_px[np.isfinite(focal_px)]):
        if not steps or focal > (1 + _SAME_FOCAL) * steps[-1]:
            steps.append(focal)
    if len(steps) < 2:
        return [camera] * len(focal_px)
    step = np.searchsorted(steps, focal_px, side="right") - 1
    known = np.isfinite(focal_px)
    return [f"{camera} {steps[i]:.0f}px" if zoom else camera for i, zoom in zip(step, known, strict=True)]


def rejected_table(rejected: Sequence[tuple[str, str]]) -> pd.DataFrame:
    """Build the table of (name, reason)."""
    return pd.DataFrame(sorted(rejected), columns=["name", "reason"], dtype="str")


def photo_ids(photos: pd.DataFrame, called: Sequence[str]) -> tuple[int, ...]:
    """Return the ids of photographs that are called by id, name, or file name; raises UsageError for an unknown one."""
    return tuple(_photo_id(photos, text.strip()) for text in called)


def _photo_id(photos: pd.DataFrame, text: str) -> int:
    file_name = photos["name"].str.rpartition("/")[2]
    here = (photos["name"] == text) | (file_name == text) | (photos["photo_id"].astype(str) == text)
    same = photos.loc[here, "photo_id"].tolist()
    if len(same) != 1:
        what = "matches several photographs" if len(same) else "is no photograph of the scene"
        first, last = photos.iloc[0], photos.iloc[-1]
        raise UsageError(
            f"{text!r} {what}",
            f"give an id from {first['photo_id']} ({first['name']}) to {last['photo_id']} ({last['name']})",
        )
    return int(same[0])
