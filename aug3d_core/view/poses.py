"""Poses between a browser and the project, and a smooth path through some.

viser's cameras are the project's own (x right, y down, z forward). Its scene is the world moved so that `middle_in_world` is
the origin, since browsers count in single precision. Its quaternions are (w, x, y, z).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from aug3d_core.geometry.transforms import homogeneous

_TURN = 0.5  # so many units of `scale` are as long as a turn by one radian
_LEAST = 1e-3  # between two views of a path, so that time never stands


@dataclass(frozen=True)
class Pose:
    """Where a camera stands and how high its picture is, as an angle."""

    world_from_cam: Float[np.ndarray, "4 4"]
    fov_rad: float


def from_browser(
    wxyz: Float[np.ndarray, " 4"], position: Float[np.ndarray, " 3"], middle_in_world: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "4 4"]:
    """Return the `world_from_cam` of a camera in the browser's scene."""
    rotation = Rotation.from_quat(np.roll(wxyz, -1)).as_matrix()
    return homogeneous(np.column_stack([rotation, position + middle_in_world]))


def to_browser(
    world_from_cam: Float[np.ndarray, "4 4"], middle_in_world: Float[np.ndarray, " 3"]
) -> tuple[Float[np.ndarray, " 4"], Float[np.ndarray, " 3"]]:
    """Return a camera's quaternion and position in the browser's scene."""
    wxyz = np.roll(Rotation.from_matrix(world_from_cam[:3, :3]).as_quat(), 1)
    return wxyz, world_from_cam[:3, 3] - middle_in_world


def intrinsics_of(fov_rad: float, size_px: tuple[int, int]) -> Float[np.ndarray, " 4"]:
    """Return (fx, fy, cx, cy) of a picture (width, height) that is so high, with square pixels."""
    width, height = size_px
    focal_px = height / 2 / np.tan(fov_rad / 2)
    return np.array([focal_px, focal_px, width / 2, height / 2])


def fov_of(intrinsics: Float[np.ndarray, " 4"], height_px: float) -> float:
    """Return how high a picture is, as an angle [rad]."""
    return float(2 * np.arctan(height_px / 2 / intrinsics[1]))


def through(keys: Float[np.ndarray, "k 4 4"], frames: int, scale: float) -> Float[np.ndarray, "f 4 4"]:
    """Return poses along a smooth path from the first of two or more key views to the last, through all others.

    scale: of the scene, in world units: what counts as far. The path slows down for turns.
    """
    turns = Rotation.from_matrix(keys[:, :3, :3])
    moved = np.linalg.norm(np.diff(keys[:, :3, 3], axis=0), axis=1) / scale
    turned = (turns[:-1].inv() * turns[1:]).magnitude()
    at = np.concatenate([[0], np.cumsum(np.maximum(moved + _TURN * turned, _LEAST))])
    when = np.linspace(0, at[-1], frames)
    eyes = CubicSpline(at, keys[:, :3, 3], bc_type="natural")(when)
    rotations = RotationSpline(at, turns)(when).as_matrix()
    return homogeneous(np.concatenate([rotations, eyes[:, :, None]], axis=2))
