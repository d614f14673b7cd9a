"""What the poses stage writes: one JSON table of poses, whatever they came from, and a model with points if there is one."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from aug3d_core.geometry.camera_models import Camera

GIVEN_POSES = "poses.json"
GIVEN_MODEL = "model"


@dataclass(frozen=True)
class Given:
    """The pose of a photograph, in the frame and unit of its source.

    camera: of the working copy. original: of the image that the pose was made for. source_id: number of the source's image.
    """

    photo_id: int
    cam_from_world: Float[np.ndarray, "3 4"]
    camera: Camera
    original: Camera
    source_id: int


def write_given(given: list[Given], folder: Path) -> None:
    """Write the table by photo id."""
    rows = [asdict(one) | {"cam_from_world": one.cam_from_world.tolist()} for one in given]
    (folder / GIVEN_POSES).write_text(json.dumps(sorted(rows, key=lambda row: row["photo_id"]), indent=1))


def read_given(folder: Path) -> list[Given]:
    """Read what `write_given` wrote."""
    rows = json.loads((folder / GIVEN_POSES).read_text())
    return [
        Given(
            row["photo_id"],
            np.array(row["cam_from_world"]),
            _camera(row["camera"]),
            _camera(row["original"]),
            row["source_id"],
        )
        for row in rows
    ]


def _camera(fields: dict) -> Camera:
    return Camera(fields["model"], fields["width"], fields["height"], tuple(fields["params"]))
