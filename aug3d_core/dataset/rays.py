"""Packed views -> rays in the world. Directions have camera z = 1, so that t is the distance along the camera's z."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.dataset.scene import Scene


@dataclass(frozen=True)
class Rays:
    """Rays with the part of them to look at: points are origin + t direction, t from near to far."""

    origins: Float[np.ndarray, "r 3"]
    directions: Float[np.ndarray, "r 3"]
    near: Float[np.ndarray, " r"]
    far: Float[np.ndarray, " r"]


def pixel_rays(scene: Scene, view: Int[np.ndarray, " r"], xy_px: Float[np.ndarray, "r 2"], slab_bounds: bool) -> Rays:
    """Return the rays through given pixels (centres at half-integers) of given views."""
    pose = scene.world_from_cam[view]
    focal, principal = np.split(scene.intrinsics[view], 2, axis=1)
    in_cam = np.concatenate([(xy_px - principal) / focal, np.ones((len(view), 1))], axis=1)
    directions = np.einsum("rij,rj->ri", pose[:, :3, :3], in_cam)
    near, far = scene.near_far[view].T
    if slab_bounds:
        near, far = scene.slab.span(pose[:, :3, 3], directions, near, far)
    return Rays(pose[:, :3, 3], directions, near, far)


def view_rays(scene: Scene, view: int, slab_bounds: bool) -> Rays:
    """Return the rays of a whole view, row by row."""
    xy_px = pixel_centres(scene.width_px, scene.height_px)
    return pixel_rays(scene, np.full(len(xy_px), view), xy_px, slab_bounds)


def pixel_centres(width_px: int, height_px: int) -> Float[np.ndarray, "r 2"]:
    """Return the centres (x, y) of all pixels, row by row."""
    y, x = np.mgrid[:height_px, :width_px]
    return np.stack([x.ravel() + 0.5, y.ravel() + 0.5], axis=1)
