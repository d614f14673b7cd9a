"""What the stage poses says of a file of poses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd

from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.poses.config import PosesConfig
from aug3d_core.poses.stage import run


def notes(folder: Path, masked: int) -> tuple[str, ...]:
    """Run the stage on three photographs with poses, some of which name a mask."""
    names = ["a.jpg", "b.jpg", "c.jpg"]
    size = {"width_px": 40, "height_px": 30, "original_width_px": 40, "original_height_px": 30}
    pd.DataFrame({"photo_id": range(3), "name": names} | size).to_parquet(folder / PHOTO_TABLE)
    frames = [{"file_path": name, "transform_matrix": np.eye(4).tolist()} for name in names]
    for frame in frames[:masked]:
        frame["mask_path"] = f"masks/{frame['file_path']}"
    camera = {"w": 40, "h": 30, "fl_x": 36.0, "cx": 20.0, "cy": 15.0}
    (folder / "transforms.json").write_text(json.dumps({**camera, "frames": frames}))
    inputs = {"given": folder / "transforms.json", "photos": folder}
    return run(inputs, PosesConfig(), folder, lambda done, total, what: None).notes


def test_masks_that_poses_name_are_said_not_to_be_read(tmp_path: Path) -> None:
    (note,) = notes(tmp_path, masked=2)
    assert "the masks that 2 poses name are not read" in note and "IMG_1_mask.png" in note


def test_poses_without_masks_say_nothing_of_them(tmp_path: Path) -> None:
    assert notes(tmp_path, masked=0) == ()
