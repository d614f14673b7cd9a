"""The layout of Mega-NeRF (Mill-19, UrbanScene3D): one `.pt` of pose and camera for each photograph.

By its code (github.com/cmusatyalab/mega-nerf: scripts/colmap_to_mega_nerf.py, scripts/copy_images.py, ray_utils.py): `c2w`
is an OpenGL camera-to-world (x right, y up, z back) whose world is x down, y right, z back, positions in units of
`pose_scale_factor` about `origin_drb`. `mappings.txt` pairs each raw photograph with its metadata; `distortion` (OpenCV's
k1 k2 p1 p2 k3) is the raw photograph's, while the copies in `train|val/rgbs` have it removed and keep the same matrix.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from aug3d_core.geometry.camera_models import Camera, cam_from_world, checked_camera, checked_pose
from aug3d_core.poses import recognise
from aug3d_core.poses.entry import Entry
from aug3d_core.poses.torch_files import read_pt
from aug3d_core.run.errors import InputError
from aug3d_core.run.regular_file import MOST_TEXT_BYTES, content

COPIES = "rgbs"
_REMEDY = "Copy the file again, or use files written by Mega-NeRF."


def read_mega_nerf(found: recognise.PoseFiles) -> list[Entry]:
    """Read every metadata file; raises InputError that names the file."""
    scale, origin = _coordinates(found.folder / recognise.COORDINATES)
    raw_names = _mappings(found.folder / recognise.MAPPINGS)
    metadata = [file for file in found.files if file.parent.name == recognise.METADATA]
    return [_entry(number, file, raw_names, scale, origin) for number, file in enumerate(metadata)]


def _entry(number: int, file: Path, raw_names: dict[str, str], scale: float, origin: np.ndarray) -> Entry:
    told, where = read_pt(file), str(file)
    pose = _array(told, "c2w", where)
    if pose.shape not in ((3, 4), (4, 4)):
        raise InputError(f"{where}: c2w has shape {pose.shape}, not (3, 4)", _REMEDY)
    pose = checked_pose(pose[:3], where)
    pose[:, 3] = pose[:, 3] * scale + origin
    width, height = (int(_one(told, key, where)) for key in ("W", "H"))
    pinhole = _array(told, "intrinsics", where).ravel()
    distortion = _array(told, "distortion", where).ravel() if "distortion" in told else np.zeros(4)
    copy = checked_camera(Camera("PINHOLE", width, height, tuple(pinhole.tolist())), where)
    names = [(f"{file.parents[1].name}/{COPIES}/{file.stem}", copy)]
    if file.name in raw_names:
        raw = checked_camera(_distorted(copy, distortion, where), where)
        names.insert(0, (raw_names[file.name], raw))
    return Entry(tuple(names), cam_from_world(pose), where, number)


def _distorted(pinhole: Camera, distortion: np.ndarray, where: str) -> Camera:
    if len(distortion) > 5:
        raise InputError(f"{where}: distortion has {len(distortion)} values, not 4 or 5", _REMEDY)
    k1, k2, p1, p2, k3 = np.append(distortion, np.zeros(5 - len(distortion))).tolist()
    if k3:
        params = (*pinhole.params, k1, k2, p1, p2, k3, 0.0, 0.0, 0.0)
        return Camera("FULL_OPENCV", pinhole.width, pinhole.height, params)
    if not any((k1, k2, p1, p2)):
        return pinhole
    return Camera("OPENCV", pinhole.width, pinhole.height, (*pinhole.params, k1, k2, p1, p2))


def _coordinates(file: Path) -> tuple[float, np.ndarray]:
    if not file.is_file():
        raise InputError(f"{file} is missing", "Copy the whole Mega-NeRF folder.")
    told = read_pt(file)
    scale = _one(told, "pose_scale_factor", str(file))
    origin = _array(told, "origin_drb", str(file)).ravel()
    if not scale > 0 or len(origin) != 3:
        raise InputError(f"{file}: pose_scale_factor {scale:g} and {len(origin)} coordinates of origin_drb", _REMEDY)
    return scale, origin


def _mappings(file: Path) -> dict[str, str]:
    """Return the name of the raw photograph of each metadata file; empty without the file: then only the copies match."""
    if not file.is_file():
        return {}
    found = {}
    for number, line in enumerate(content(file, MOST_TEXT_BYTES).decode(errors="replace").splitlines(), start=1):
        photo, comma, metadata = line.strip().rpartition(",")
        if line.strip() and not (comma and photo):
            raise InputError(f"{file}, line {number}: {line!r} is not `photograph,metadata.pt`", _REMEDY)
        found[metadata] = photo
    return found


def _one(content: dict[str, Any], key: str, where: str) -> float:
    values = _array(content, key, where)
    if values.size != 1:
        raise InputError(f"{where}: {key} is not one number", _REMEDY)
    return values.item()


def _array(content: dict[str, Any], key: str, where: str) -> np.ndarray:
    if key not in content:
        raise InputError(f"{where} has no {key}", _REMEDY)
    try:
        values = np.array(content[key], float)
    except (TypeError, ValueError, OverflowError):
        values = np.array(np.nan)
    if not np.isfinite(values).all():
        raise InputError(f"{where}: {key} has values that are not finite numbers", _REMEDY)
    return values
