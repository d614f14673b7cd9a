"""The layout of pixelSplat, MVSplat and DepthSplat: files of many sequences, with an `index.json`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float

from aug3d_core.export.taken import TEST, TRAIN, Taken
from aug3d_core.geometry.transforms import invert

_CHUNK_BYTES = 100 * 2**20
_MICROSECONDS = 33_333  # between two timestamps; they only tell the order


def write_chunks(taken: Sequence[Taken], folder: Path) -> None:
    """Write sequences, each part in a folder with an index of its own."""
    for part in (TRAIN, TEST):
        _write_part([one for one in taken if one.part == part], folder / part)


def _write_part(taken: Sequence[Taken], folder: Path) -> None:
    index: dict[str, str] = {}
    chunk: list[dict[str, Any]] = []
    size = number = 0
    for place, one in enumerate(taken):
        images = [one.png(int(view)) for view in one.rows]
        cameras = np.stack([camera(one, int(view)) for view in one.rows])
        chunk.append(
            {
                "url": "",
                "timestamps": torch.arange(len(one.rows), dtype=torch.int64) * _MICROSECONDS,
                "cameras": torch.from_numpy(cameras.astype(np.float32)),
                "images": [torch.frombuffer(bytearray(data), dtype=torch.uint8) for data in images],
                "key": one.key,
            }
        )
        size += sum(map(len, images))
        index[one.key] = f"{number:06d}.torch"
        if size >= _CHUNK_BYTES or place == len(taken) - 1:
            torch.save(chunk, folder / f"{number:06d}.torch")
            chunk, size, number = [], 0, number + 1
    (folder / "index.json").write_text(json.dumps(index, indent=1))


def camera(one: Taken, view: int) -> Float[np.ndarray, " 18"]:
    """Return fx, fy, cx, cy as shares of the image, two zeros, and world-to-camera row by row (OpenCV axes)."""
    size = np.array([one.fit.width_px, one.fit.height_px] * 2)
    world_to_cam = invert(one.scene.world_from_cam[view][:3])
    return np.concatenate([one.intrinsics(view) / size, [0.0, 0.0], world_to_cam.ravel()])
