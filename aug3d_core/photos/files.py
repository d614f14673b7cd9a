"""The files that the stages of this package write."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, SupportsIndex

if TYPE_CHECKING:
    import pandas as pd

PHOTO_TABLE = "photos.parquet"
REJECTED_TABLE = "rejected.parquet"
PHOTO_IMAGES = "images"
PHOTO_MASKS = "masks"  # of the photographs that have one
CONTACT_SHEET = "contact_sheet.jpg"
CONTROL_TABLE = "control.parquet"  # there if the folder has ground control points
REDUNDANT = "redundant"  # begins the reason of a photograph that could be used, and need not


def image_name(photo_id: SupportsIndex) -> str:
    """Name of a photograph's file inside `images/`, in any stage."""
    return f"{photo_id:06d}.png"


def mask_path(folder: Path, photo_id: SupportsIndex) -> Path:
    """Path of a photograph's mask in the output of a stage that writes masks; there is none where it is used whole."""
    return folder / PHOTO_MASKS / image_name(photo_id)


def read_photos(folder: Path) -> pd.DataFrame:
    """Read the photo table from the photos stage's output."""
    import pandas as pd  # which most commands do without

    return pd.read_parquet(folder / PHOTO_TABLE)


def read_control_marks(folder: Path) -> pd.DataFrame | None:
    """Read the marks of ground control points from the photos stage's output; None without any."""
    import pandas as pd

    return pd.read_parquet(folder / CONTROL_TABLE) if (folder / CONTROL_TABLE).is_file() else None
