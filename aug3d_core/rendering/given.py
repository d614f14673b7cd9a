"""Read and check the inputs before a worker starts: Blender renders broken ones as black or pink."""

from __future__ import annotations

from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from PIL import Image

from aug3d_core.geometry.ply import Mesh
from aug3d_core.rendering.job import MeshFile
from aug3d_core.run.errors import InputError
from aug3d_core.surface.files import MESH, MESH_TEXTURE, TEXTURED_MESH

_CAMERA_ARRAYS = ("view_id", "dome_id", "world_from_cam", "intrinsics", "size")
_PLAN_AGAIN = "Run the stage sampling again."
_MESH_AGAIN = "Run the stage surface again."


def read_cameras(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays of the camera file; raises InputError that names the view that cannot be rendered."""
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            cameras = {name: file[name] for name in _CAMERA_ARRAYS}
    except (OSError, KeyError, ValueError, BadZipFile) as error:
        raise InputError(f"{path.name} cannot be read ({error})", _PLAN_AGAIN) from error
    views = len(cameras["view_id"])
    for name, array in cameras.items():
        if len(array) != views:
            raise InputError(f"{path.name}: {name} has {len(array)} rows for {views} views", _PLAN_AGAIN)
    if not views:
        return cameras
    _refuse(cameras, "has a pose that is not finite", ~_finite(cameras["world_from_cam"]))
    _refuse(cameras, "has intrinsics that are not finite", ~_finite(cameras["intrinsics"]))
    _refuse(cameras, "has a focal length that is not positive", (cameras["intrinsics"][:, :2] <= 0).any(axis=1))
    _refuse(cameras, "has no pixels", (cameras["size"] < 1).any(axis=1))
    if len(np.unique(cameras["size"], axis=0)) > 1:
        raise InputError("the planned views differ in size", "Plan all views at the data set's one size.")
    return cameras


def _finite(rows: np.ndarray) -> np.ndarray:
    return np.isfinite(rows).reshape(len(rows), -1).all(axis=1)


def _refuse(cameras: dict[str, np.ndarray], what: str, bad: np.ndarray) -> None:
    if bad.any():
        which = cameras["view_id"][bad]
        others = f" (and {len(which) - 1} others)" if len(which) > 1 else ""
        raise InputError(f"planned view {which[0]} {what}{others}", _PLAN_AGAIN)


def find_mesh(surface: Path) -> MeshFile:
    """Return the mesh of train photos, with its texture if it has one; raises InputError if there is nothing to show."""
    textured, texture = surface / TEXTURED_MESH, surface / MESH_TEXTURE
    found = MeshFile(path=textured, texture=texture) if textured.exists() else MeshFile(path=surface / MESH)
    try:
        triangles = _triangles(found)
    except (OSError, KeyError, ValueError, BadZipFile) as error:
        raise InputError(f"the mesh {found.path.name} cannot be read ({error})", _MESH_AGAIN) from error
    if not triangles:
        raise InputError(f"the mesh {found.path.name} has no triangles", "Give photographs that overlap more.")
    if found.texture:
        _check_picture(found.texture)
    return found


def _triangles(mesh: MeshFile) -> int:
    if mesh.texture is None:
        return len(Mesh.load(mesh.path).triangles)
    with mesh.path.open("rb") as stream, np.load(stream, allow_pickle=False) as arrays:
        return min(len(arrays["triangles"]), len(arrays["uv"]))


def _check_picture(path: Path) -> None:
    try:
        with Image.open(path) as image:
            image.load()
    except (OSError, SyntaxError) as error:  # Pillow calls a broken PNG a syntax error
        raise InputError(f"the texture {path.name} cannot be read ({error})", _MESH_AGAIN) from error
