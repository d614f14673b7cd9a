"""Pinhole cameras at the size of the depth maps, and what two of them make of a plane. Plain numpy.

Arrays are indexed at pixel centres, which lie at half-integers: `matrix` is the one that maps to array indices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.geometry.views import Views


@dataclass(frozen=True)
class Camera:
    """One camera: pose, intrinsics in px (half-integer pixel centres) and size."""

    cam_from_world: Float[np.ndarray, "3 4"]
    intrinsics: Float[np.ndarray, " 4"]
    width: int
    height: int

    @property
    def matrix(self) -> Float[np.ndarray, "3 3"]:
        """Return K that maps camera coordinates to array indices (x right, y down)."""
        fx, fy, cx, cy = self.intrinsics
        return np.array([[fx, 0.0, cx - 0.5], [0.0, fy, cy - 0.5], [0.0, 0.0, 1.0]])

    @property
    def rays(self) -> Float[np.ndarray, "h w 3"]:
        """Return the direction with z = 1 through each pixel centre, in the camera's frame."""
        fx, fy, cx, cy = self.intrinsics
        x = (np.arange(self.width) + 0.5 - cx) / fx
        y = (np.arange(self.height) + 0.5 - cy) / fy
        return np.stack([*np.meshgrid(x, y), np.ones((self.height, self.width))], axis=-1)


def camera_of(views: Views, view: int, size: Int[np.ndarray, " 2"]) -> Camera:
    """Return the camera of a view whose image is resized to `size` (width, height)."""
    scale = size / views.size[view]
    return Camera(views.cam_from_world[view], views.intrinsics[view] * np.tile(scale, 2), int(size[0]), int(size[1]))


def depth_sizes(views: Views, max_px: int) -> Int[np.ndarray, "n 2"]:
    """Return width and height of each view's depth map: the photograph's, made no wider than `max_px`."""
    scale = np.minimum(1.0, max_px / views.size[:, 0])
    return np.maximum(np.rint(views.size * scale[:, None]), 1).astype(int)


def relative_pose(reference: Camera, source: Camera) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, " 3"]]:
    """Return R, t that map points from the reference camera to the source camera: X_s = R X_r + t."""
    rotation = source.cam_from_world[:, :3] @ reference.cam_from_world[:, :3].T
    return rotation, source.cam_from_world[:, 3] - rotation @ reference.cam_from_world[:, 3]
