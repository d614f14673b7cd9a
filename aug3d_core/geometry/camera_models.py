"""Camera models and their exact scaling, and poses between conventions. Plain numpy.

Camera models and the order of their parameters are COLMAP's (its `sensor/models.h`). A distortion acts on directions, not
on pixels, so that scaling a photograph changes focal lengths and principal point alone; pixel centres are at half-integers,
so that both scale without an offset.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from aug3d_core.geometry.transforms import invert
from aug3d_core.run.errors import InputError

# Model -> how many distortion parameters follow; those with one focal length -> the model with two that holds them.
_TWO_FOCAL = {"PINHOLE": 0, "OPENCV": 4, "OPENCV_FISHEYE": 4, "FULL_OPENCV": 8, "FOV": 1, "THIN_PRISM_FISHEYE": 8}
_ONE_FOCAL = {
    "SIMPLE_PINHOLE": (0, "PINHOLE"),
    "SIMPLE_RADIAL": (1, "OPENCV"),
    "RADIAL": (2, "OPENCV"),
    "SIMPLE_RADIAL_FISHEYE": (1, "OPENCV_FISHEYE"),
    "RADIAL_FISHEYE": (2, "OPENCV_FISHEYE"),
}
CAMERA_MODELS = (*_TWO_FOCAL, *_ONE_FOCAL)
_NOT_A_ROTATION = 1e-3  # poses are stored with 7 digits or more


@dataclass(frozen=True)
class Camera:
    """A camera of COLMAP's kinds, for an image of width x height px."""

    model: str
    width: int
    height: int
    params: tuple[float, ...]


def checked_camera(camera: Camera, where: str) -> Camera:
    """Return the camera; raises InputError that says `where` if it cannot be one."""
    if camera.model not in CAMERA_MODELS:
        raise InputError(
            f"{where}: camera model {camera.model!r} is not known", f"Known models: {', '.join(CAMERA_MODELS)}."
        )
    count = _TWO_FOCAL[camera.model] + 4 if camera.model in _TWO_FOCAL else _ONE_FOCAL[camera.model][0] + 3
    if len(camera.params) != count or not np.isfinite(camera.params).all():
        raise InputError(
            f"{where}: camera parameters {list(camera.params)} are not {count} finite numbers", "Mend the camera there."
        )
    size_known = camera.width > 0 and camera.height > 0
    focal_px = camera.params[: 2 if camera.model in _TWO_FOCAL else 1]
    if not size_known or not all(0.05 < focal / max(camera.width, camera.height) < 100 for focal in focal_px):
        raise InputError(
            f"{where}: a focal length of {focal_px[0]:g} px cannot belong to an image of {camera.width}x{camera.height} "
            "px",
            "Give size and focal length of the same image, in pixels.",
        )
    return camera


def same_shape(camera: Camera, width: int, height: int) -> bool:
    """Say whether an image of width x height px can be the camera's image resized to whole pixels."""
    slack = 1 / min(camera.width, camera.height, width, height)
    return abs(camera.width * height / (camera.height * width) - 1) <= slack


def scaled(camera: Camera, width: int, height: int) -> Camera:
    """Return the camera of the same image resized to width x height px, exactly.

    Sides are whole pixels, so the two axes may scale a little differently: a model with one focal length then becomes the
    one with two.
    """
    across, down = width / camera.width, height / camera.height
    if across != down and camera.model in _ONE_FOCAL:
        distortion, wider = _ONE_FOCAL[camera.model]
        focal_px, *rest = camera.params
        padding = (0.0,) * (_TWO_FOCAL[wider] - distortion)
        camera = replace(camera, model=wider, params=(focal_px, focal_px, *rest, *padding))
    axes = (across, down, across, down) if camera.model in _TWO_FOCAL else (across, across, down)
    params = tuple(value * scale for value, scale in zip(camera.params[: len(axes)], axes, strict=True))
    return Camera(camera.model, width, height, (*params, *camera.params[len(axes) :]))


def checked_pose(world_from_cam: Float[np.ndarray, "3 4"], where: str) -> Float[np.ndarray, "3 4"]:
    """Return the pose with its rotation made exact; raises InputError that says `where` if it is no rigid transform."""
    if not np.isfinite(world_from_cam).all():
        raise InputError(f"{where}: the pose holds a value that is not a finite number", "Mend or remove that entry.")
    u, singular, vt = np.linalg.svd(world_from_cam[:, :3])
    if np.abs(singular - 1).max() > _NOT_A_ROTATION or np.linalg.det(u @ vt) < 0:
        raise InputError(
            f"{where}: the left 3x3 of the pose is not a rotation (singular values {np.round(singular, 4).tolist()}, "
            f"determinant {np.linalg.det(world_from_cam[:, :3]):.4g})",
            "Give poses without scale and without mirroring.",
        )
    return np.concatenate([u @ vt, world_from_cam[:, 3:]], axis=1)


def cam_from_world(world_from_gl: Float[np.ndarray, "*n 3 4"]) -> Float[np.ndarray, "*n 3 4"]:
    """Turn OpenGL camera-to-world (x right, y up, z back) into our world-to-camera (x right, y down, z forward)."""
    return invert(_flip(world_from_gl))


def world_from_gl(cam_from_world: Float[np.ndarray, "*n 3 4"]) -> Float[np.ndarray, "*n 3 4"]:
    """Turn our world-to-camera into OpenGL camera-to-world."""
    return _flip(invert(cam_from_world))


def _flip(world_from_cam: Float[np.ndarray, "*n 3 4"]) -> Float[np.ndarray, "*n 3 4"]:
    return world_from_cam * np.array([1.0, -1.0, -1.0, 1.0])
