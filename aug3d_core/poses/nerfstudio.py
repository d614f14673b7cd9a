"""Read nerfstudio's `transforms.json`.

Format: docs.nerf.studio, "Data conventions". Poses are OpenGL camera-to-world. A camera value is in the frame, or else at
the top for all frames. `applied_transform` records a rotation of the world; the world of given poses is arbitrary to us, so
it is not undone.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from aug3d_core.geometry.camera_models import Camera, cam_from_world, checked_camera, checked_pose
from aug3d_core.poses.entry import Entry
from aug3d_core.run.errors import InputError
from aug3d_core.run.regular_file import json_content

_MODELS = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "OPENCV_FISHEYE")


def read_transforms(file: Path) -> list[Entry]:
    """Read every frame; raises InputError that names the file and the frame."""
    try:
        whole = json_content(file)
    except (ValueError, OSError) as error:
        raise InputError(f"{file} cannot be read as JSON: {error}", "Copy it again: it may be truncated.") from error
    frames = whole.get("frames") if isinstance(whole, dict) else None
    if not isinstance(frames, list) or not frames:
        raise InputError(f"{file} has no list `frames`", "Use a transforms.json as nerfstudio writes it.")
    entries, seen = [], {}
    for number, frame in enumerate(frames):
        where = f"{file}, frame {number}"
        if not isinstance(frame, dict):
            raise InputError(f"{where} is not an object", "Use a transforms.json as nerfstudio writes it.")
        name = _value(frame, "file_path", where)
        if not _is_name(name):
            raise InputError(f"{where}: file_path {name!r} is not a name", "Name the photograph of that frame.")
        where = f"{where} ({name})"
        if name in seen:
            raise InputError(f"{where} names the same file as frame {seen[name]}", "Keep one of the two frames.")
        seen[name] = number
        pose = checked_pose(_matrix(_value(frame, "transform_matrix", where), where), where)
        camera = checked_camera(_camera({**whole, **frame}, where), where)
        mask = frame.get("mask_path")
        if mask is not None and not _is_name(mask):
            raise InputError(f"{where}: mask_path {mask!r} is not a name", "Name the mask of that frame, or none.")
        entries.append(Entry(((name, camera),), cam_from_world(pose), where, number, mask))
    return entries


def _is_name(name: Any) -> bool:
    if not isinstance(name, str) or not name:
        return False
    try:
        name.encode()
    except UnicodeEncodeError:  # half of a pair, which JSON can hold and a file's name cannot
        return False
    return True


def _value(fields: Mapping[str, Any], key: str, where: str) -> Any:
    if key not in fields:
        raise InputError(
            f"{where} has no {key}", f"Add {key} to the frame, or to the top of the file if it is the same for all."
        )
    return fields[key]


def _number(fields: Mapping[str, Any], key: str, where: str) -> float:
    value = _value(fields, key, where)
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise InputError(f"{where}: {key} = {value!r} is not a finite number", f"Correct {key}.")
    return float(value)


def _matrix(rows: Any, where: str) -> np.ndarray:
    try:
        matrix = np.array(rows, float)
    except (TypeError, ValueError, OverflowError):
        matrix = np.zeros(0)
    if matrix.shape not in ((4, 4), (3, 4)):
        raise InputError(f"{where}: transform_matrix is not 4x4 numbers", "Correct or remove that frame.")
    return matrix[:3]


def _camera(fields: Mapping[str, Any], where: str) -> Camera:
    model = fields.get("camera_model", "OPENCV")
    if model not in _MODELS:
        raise InputError(f"{where}: camera_model {model!r} is not known", f"Known models: {', '.join(_MODELS)}.")
    fields = {"fl_y": fields.get("fl_x"), **fields}
    pinhole = tuple(_number(fields, key, where) for key in ("fl_x", "fl_y", "cx", "cy"))
    width, height = int(_number(fields, "w", where)), int(_number(fields, "h", where))
    k1, k2, k3, k4, p1, p2 = (_number({key: 0.0, **fields}, key, where) for key in ("k1", "k2", "k3", "k4", "p1", "p2"))
    if model == "OPENCV_FISHEYE" or fields.get("is_fisheye"):
        return Camera("OPENCV_FISHEYE", width, height, (*pinhole, k1, k2, k3, k4))
    if k4:
        raise InputError(f"{where}: k4 = {k4:g} has no counterpart in camera model {model}", "Refit without k4.")
    if k3:
        return Camera("FULL_OPENCV", width, height, (*pinhole, k1, k2, p1, p2, k3, 0.0, 0.0, 0.0))
    if any((k1, k2, p1, p2)):
        return Camera("OPENCV", width, height, (*pinhole, k1, k2, p1, p2))
    return Camera("PINHOLE", width, height, pinhole)
