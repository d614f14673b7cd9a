"""A pose as it stands in a file of poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aug3d_core.geometry.camera_models import Camera


@dataclass(frozen=True)
class Entry:
    """A pose as it stands in a file. names: what the photograph may be called there, each with the camera it then has.

    where: how an error names the entry. source_id: its number there. mask: the file of the photograph's mask, as a path from
    the file of poses; None where none is named.
    """

    names: tuple[tuple[str, Camera], ...]
    cam_from_world: Float[np.ndarray, "3 4"]
    where: str
    source_id: int
    mask: str | None = None
