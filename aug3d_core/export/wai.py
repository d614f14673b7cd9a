"""The layout of map-anything: a folder for each sequence, nerfstudio's with OpenCV poses, depth and masks."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from PIL import Image

from aug3d_core.export.taken import DEPTH, MASKS, Taken


def write_wai(taken: Sequence[Taken], folder: Path) -> None:
    """Write sequences, each in a folder of its part."""
    for one in taken:
        _write(one, folder / one.part / one.key)


def _write(one: Taken, folder: Path) -> None:
    scene = one.scene
    deep = bool(scene.depth[one.rows].any())
    holes = bool((scene.alpha[one.rows] < 255).any())
    frames = []
    for name, view in zip(one.write_images(folder), one.rows.tolist(), strict=True):
        fx, fy, cx, cy = one.intrinsics(view).tolist()
        stem = Path(name).stem
        frame: dict[str, Any] = {
            "frame_name": stem, "file_path": name, "image": name,
            "transform_matrix": scene.world_from_cam[view].tolist(), "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy,
            "w": one.fit.width_px, "h": one.fit.height_px,
        }  # fmt: skip
        if deep:
            frame["depth"] = f"{DEPTH}/{stem}.exr"
            _write_exr(one.depth(view), folder / frame["depth"])
        if holes:
            frame["mask"] = f"{MASKS}/{stem}.png"
            (folder / MASKS).mkdir(exist_ok=True)
            Image.fromarray(one.mask(view)).save(folder / frame["mask"])
        frames.append(frame)
    kinds = {"image": "image"} | ({"depth": "depth"} if deep else {}) | ({"mask": "binary"} if holes else {})
    meta = {
        "scene_name": one.key,
        "dataset_name": "aug3d",
        "version": "0.1",
        "last_modified": datetime.now(UTC).replace(tzinfo=None).isoformat(),
        "shared_intrinsics": False,
        "camera_model": "PINHOLE",
        "camera_convention": "opencv",
        "frames": frames,
        "scene_modalities": {},
        "frame_modalities": {name: {"frame_key": name, "format": kind} for name, kind in kinds.items()},
    }
    (folder / "scene_meta.json").write_text(json.dumps(meta, indent=1))


def _write_exr(depth: Float[np.ndarray, "h w"], path: Path) -> None:
    import OpenEXR  # pyright: ignore[reportMissingImports]  # has no type information

    path.parent.mkdir(exist_ok=True)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"Y": np.ascontiguousarray(depth)}) as file:
        file.write(str(path))
