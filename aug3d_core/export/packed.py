"""Packed scenes -> the layouts that other feed-forward models train on.

chunks  of pixelSplat, MVSplat and DepthSplat: `{train,test}/000000.torch` with an `index.json` each, and
        `evaluation_index.json` with the held-out targets
wai     of map-anything: a folder for each sequence, nerfstudio's layout with OpenCV poses, depth and masks

A sequence is what their loaders draw views from: the training photographs of a scene, in the order of the flight; a dome; the
flight over a made-up town; a test group, its inputs and its target. Views keep the size that they are packed at.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int
from PIL import Image

from aug3d_core.dataset.scene import SPLITS, Scene
from aug3d_core.export.target_folder import check_empty
from aug3d_core.geometry.transforms import invert
from aug3d_core.photos.files import image_name
from aug3d_core.run.errors import UsageError

CHUNKS, WAI = "chunks", "wai"
PACKED_FORMATS = (CHUNKS, WAI)
TRAIN, TEST = "train", "test"
EVALUATION_INDEX = "evaluation_index.json"
_CHUNK_BYTES = 100 * 2**20
_MICROSECONDS = 33_333  # between two timestamps; they only tell the order


@dataclass(frozen=True)
class Taken:
    """Views of a scene that belong together. context, target: places in `rows`, of a test alone."""

    key: str
    part: str
    scene: Scene
    rows: Int[np.ndarray, " v"]
    context: tuple[int, ...] = ()
    target: tuple[int, ...] = ()


def export_packed(scenes: Sequence[tuple[str, Scene, bool]], form: str, folder: Path) -> dict[str, int]:
    """Write scenes, each with its name and whether it may be trained on; return how many sequences are in each part.

    Raises UsageError if the folder is not empty, or there is no such format.
    """
    if form not in PACKED_FORMATS:
        raise UsageError(f"there is no format {form!r}", f"choose one of {', '.join(PACKED_FORMATS)}")
    check_empty(folder)
    taken = [one for name, scene, trained in scenes for one in sequences(name, scene, trained)]
    folder.mkdir(parents=True, exist_ok=True)
    for part in (TRAIN, TEST):
        own = [one for one in taken if one.part == part]
        _write_chunks(own, folder / part) if form == CHUNKS else [_write_wai(one, folder / part) for one in own]
    index = {one.key: {"context": list(one.context), "target": list(one.target)} for one in taken if one.target}
    (folder / EVALUATION_INDEX).write_text(json.dumps(index, indent=1))
    return {part: sum(one.part == part for one in taken) for part in (TRAIN, TEST)}


def sequences(name: str, scene: Scene, trained: bool) -> Iterator[Taken]:
    """Yield the sequences of a scene; of one that is held out, its test alone."""
    if trained:
        usable = scene.splits == SPLITS.index("train")
        flight = np.flatnonzero(usable & (scene.dome_id < 0))
        if len(flight):
            yield Taken(name, TRAIN, scene, flight)
        for dome in np.unique(scene.dome_id[scene.dome_id >= 0]):
            yield Taken(f"{name}-dome-{dome:05d}", TRAIN, scene, np.flatnonzero(scene.dome_id == dome))
    for number, members in enumerate(scene.groups["test"]):
        rows = np.sort(members)
        target = int(np.flatnonzero(rows == members[0])[0])
        context = tuple(place for place in range(len(rows)) if place != target)
        yield Taken(f"{name}-test-{number:05d}", TEST, scene, rows, context, (target,))


def chunk_camera(scene: Scene, view: int) -> Float[np.ndarray, " 18"]:
    """Return fx, fy, cx, cy as shares of the image, two zeros, and world-to-camera row by row (OpenCV axes)."""
    size = np.array([scene.width_px, scene.height_px] * 2)
    world_to_cam = invert(scene.world_from_cam[view][:3])
    return np.concatenate([scene.intrinsics[view] / size, [0.0, 0.0], world_to_cam.ravel()])


def _write_chunks(taken: Sequence[Taken], folder: Path) -> None:
    folder.mkdir()
    index: dict[str, str] = {}
    chunk: list[dict[str, Any]] = []
    size = number = 0
    for place, one in enumerate(taken):
        images = [_png(one.scene, int(view)) for view in one.rows]
        cameras = np.stack([chunk_camera(one.scene, int(view)) for view in one.rows])
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


def _write_wai(one: Taken, top: Path) -> None:
    folder, scene = top / one.key, one.scene
    (folder / "images").mkdir(parents=True)
    deep = bool(scene.depth[one.rows].any())
    holes = bool((scene.alpha[one.rows] < 255).any())
    frames = []
    for number, view in enumerate(one.rows):
        name = image_name(number)
        (folder / "images" / name).write_bytes(_png(scene, int(view)))
        fx, fy, cx, cy = scene.intrinsics[view].tolist()
        frame: dict[str, Any] = {
            "frame_name": Path(name).stem, "file_path": f"images/{name}", "image": f"images/{name}",
            "transform_matrix": scene.world_from_cam[view].tolist(), "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy,
            "w": scene.width_px, "h": scene.height_px,
        }  # fmt: skip
        if deep:
            frame["depth"] = f"depth/{Path(name).stem}.exr"
            _write_exr(scene.depth[view].astype(np.float32), folder / frame["depth"])
        if holes:
            frame["mask"] = f"masks/{name}"
            (folder / "masks").mkdir(exist_ok=True)
            Image.fromarray(np.where(scene.alpha[view] >= 128, 255, 0).astype(np.uint8)).save(folder / frame["mask"])
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


def _png(scene: Scene, view: int) -> bytes:
    file = io.BytesIO()
    Image.fromarray(scene.images[view]).save(file, format="PNG")
    return file.getvalue()


def _write_exr(depth: Float[np.ndarray, "h w"], path: Path) -> None:
    import OpenEXR  # pyright: ignore[reportMissingImports]  # has no type information

    path.parent.mkdir(exist_ok=True)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"Y": np.ascontiguousarray(depth)}) as file:
        file.write(str(path))
