"""Detect truncated binary COLMAP models: pycolmap trusts the counts in damaged files, and may read for minutes.

Layout: COLMAP's `scene/reconstruction_io_binary.cc`; little endian, each file begins with the number of its records.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

from aug3d_core.run.errors import InputError
from aug3d_core.run.regular_file import content

_COUNT = struct.Struct("<Q")
_CAMERA = struct.Struct("<IiQQ")  # id, model, width, height; then the parameters
_PARAMETERS = (3, 4, 4, 5, 8, 8, 12, 5, 4, 5, 12)  # by the number of the model
_IMAGE_BYTES, _OBSERVATION_BYTES = 64, 24  # id, quaternion, translation, camera; then name, observations
_POINT_BYTES, _ELEMENT_BYTES = 43, 8  # id, place, colour, error; then the track
_NUMBER = struct.Struct("<I")
_ID_BYTES, _SENSOR_BYTES, _POSE_BYTES = 4, 8, 56


def check_binary(folder: Path) -> None:
    """Raise InputError that names the file if one of them ends before its records do."""
    for name, skip in _SKIP.items():
        file = folder / f"{name}.bin"
        if file.is_file():
            _check(file, skip)


def _check(file: Path, skip: Callable[[bytes, int], int]) -> None:
    data = content(file)
    at = _COUNT.size
    try:
        (count,) = _COUNT.unpack_from(data)
        for _ in range(count):
            at = skip(data, at)
            if at > len(data):
                break
    except (struct.error, ValueError):
        at = len(data) + 1
    if at > len(data):
        raise InputError(
            f"{file} is damaged: it ends after {len(data)} bytes, before the number of records in its header",
            "Copy the model again.",
        )


def _skip_camera(data: bytes, at: int) -> int:
    _, model, _, _ = _CAMERA.unpack_from(data, at)
    # pycolmap reports newer models by name; the size of what follows them is unknown here.
    return at + _CAMERA.size + 8 * _PARAMETERS[model] if 0 <= model < len(_PARAMETERS) else at + _CAMERA.size


def _skip_image(data: bytes, at: int) -> int:
    at = data.index(b"\0", at + _IMAGE_BYTES) + 1
    return at + _COUNT.size + _OBSERVATION_BYTES * _COUNT.unpack_from(data, at)[0]


def _skip_point(data: bytes, at: int) -> int:
    at += _POINT_BYTES
    return at + _COUNT.size + _ELEMENT_BYTES * _COUNT.unpack_from(data, at)[0]


def _skip_rig(data: bytes, at: int) -> int:
    (sensors,) = _NUMBER.unpack_from(data, at + _ID_BYTES)
    at += _ID_BYTES + _NUMBER.size + (_SENSOR_BYTES if sensors else 0)
    for _ in range(1, sensors):  # the first has no pose: the others are relative to it
        (has_pose,) = struct.unpack_from("<?", data, at + _SENSOR_BYTES)
        at += _SENSOR_BYTES + 1 + (_POSE_BYTES if has_pose else 0)
    return at


def _skip_frame(data: bytes, at: int) -> int:
    at += 2 * _ID_BYTES + _POSE_BYTES
    return at + _NUMBER.size + (_SENSOR_BYTES + _COUNT.size) * _NUMBER.unpack_from(data, at)[0]


_SKIP = {
    "cameras": _skip_camera,
    "images": _skip_image,
    "points3D": _skip_point,
    "rigs": _skip_rig,
    "frames": _skip_frame,
}
