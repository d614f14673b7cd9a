"""A scene's poses, points and undistorted photographs -> a folder for COLMAP or nerfstudio.

The world is that of the scene: ENU metres or level scene units, z up. Photographs keep their names with `.png` added: they
are undistorted copies, not the originals. For COLMAP, white space in names becomes `_`.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from aug3d_core.export.colmap_text import write_model
from aug3d_core.export.target_folder import filling
from aug3d_core.geometry.camera_models import world_from_gl
from aug3d_core.geometry.masks import save_mask, used_pixels
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import homogeneous
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.photos.files import PHOTO_TABLE, image_name, read_photos
from aug3d_core.poses.recognise import CLOUD, COLMAP, DTU, GLB, MAP, NERFSTUDIO, TRANSFORMS
from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.sfm.files import POINTS, TRACKS, VIEW_IMAGES, VIEW_MASKS, VIEWS
from aug3d_core.store.record import Record

FORMATS = (COLMAP, NERFSTUDIO)
IMAGES = "images"
_MODEL = "sparse/0"
_CLOUD = "sparse_pc.ply"
_COPY = ".png"
_MASKS = "masks"


def read_of(record: Record) -> list[str]:
    """Return the files that `export` reads of an output of stage sfm or photos."""
    if record.stage == "photos":
        return [name for name in record.files if name == PHOTO_TABLE]
    return [
        name
        for name in record.files
        if name in (VIEWS, POINTS, TRACKS) or name.startswith((f"{VIEW_IMAGES}/", f"{VIEW_MASKS}/"))
    ]


def export(sfm: Path, photos: Path, form: str, folder: Path) -> int:
    """Write a scene's sfm output in a format, and return the number of views.

    Raises UsageError if the folder is not empty, StoreError if the scene's files are missing.
    """
    if form not in FORMATS:
        raise UsageError(f"there is no format {form!r}", f"choose one of {', '.join((*FORMATS, DTU, MAP, GLB, CLOUD))}")
    with filling(folder):
        if not ((sfm / VIEWS).is_file() and (photos / PHOTO_TABLE).is_file()):
            raise StoreError(
                f"the scene's files are missing in {sfm} or {photos}", "run the scene again, then export it"
            )
        views, points = Views.load(sfm / VIEWS), Points.load(sfm / POINTS)
        table = read_photos(photos)
        original = dict(zip(table["photo_id"], table["name"], strict=True))
        names = [f"{original[photo_id]}{_COPY}" for photo_id in views.photo_id]
        if form == COLMAP:
            names = _without_spaces(names)
        for photo_id, name in zip(views.photo_id, names, strict=True):
            target = folder / IMAGES / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(sfm / VIEW_IMAGES / image_name(photo_id), target)
        if form == COLMAP:
            write_model(views, points, Tracks.load(sfm / TRACKS), names, folder / _MODEL)
        else:
            _write_nerfstudio(views, points, names, _masks(sfm, views, names, folder), folder)
        return len(views)


def _without_spaces(names: Sequence[str]) -> list[str]:
    """Return unique names without white space: COLMAP's reader ends a name there."""
    taken, plain = set(names), []
    for name in names:
        other = re.sub(r"\s", "_", name)
        while other != name and other in taken:
            other = f"{other.removesuffix(_COPY)}_{_COPY}"
        taken.add(other)
        plain.append(other)
    return plain


def _masks(sfm: Path, views: Views, names: Sequence[str], folder: Path) -> bool:
    """Write a mask of every photograph if any has one, as nerfstudio wants it, and say whether any has."""
    found = [used_pixels(sfm / VIEW_MASKS / image_name(photo_id)) for photo_id in views.photo_id]
    if all(used is None for used in found):
        return False
    for used, size, name in zip(found, views.size, names, strict=True):
        save_mask(np.ones(size[::-1], bool) if used is None else used, folder / _MASKS / name)
    return True


def _write_nerfstudio(views: Views, points: Points, names: Sequence[str], masked: bool, folder: Path) -> None:
    poses = homogeneous(world_from_gl(views.cam_from_world))
    frames = [
        {"file_path": f"{IMAGES}/{name}"}
        | ({"mask_path": f"{_MASKS}/{name}"} if masked else {})
        | {"transform_matrix": pose.tolist(), **_camera(size, intrinsics)}
        for name, pose, size, intrinsics in zip(names, poses, views.size, views.intrinsics, strict=True)
    ]
    whole = {"camera_model": "OPENCV", "ply_file_path": _CLOUD, "frames": frames}
    (folder / TRANSFORMS).write_text(json.dumps(whole, indent=1))
    Mesh(points.xyz, points.rgb, np.zeros((0, 3), int)).save(folder / _CLOUD)


def _camera(size: np.ndarray, intrinsics: np.ndarray) -> dict[str, float | int]:
    fl_x, fl_y, cx, cy = intrinsics.tolist()
    return {"w": int(size[0]), "h": int(size[1]), "fl_x": fl_x, "fl_y": fl_y, "cx": cx, "cy": cy}
