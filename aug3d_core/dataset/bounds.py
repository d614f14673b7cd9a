"""Near and far of a whole view, from the slab and from the depths that it is known to see."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from aug3d_core.dataset.slab import Slab
from aug3d_core.geometry.transforms import apply

GRID = 5  # rays per side at which a view's slab is measured; the outermost touch the image's edges


def edge_rays(
    world_from_cam: Float[np.ndarray, "4 4"], intrinsics: Float[np.ndarray, " 4"], width_px: int, height_px: int
) -> tuple[Float[np.ndarray, "r 3"], Float[np.ndarray, "r 3"]]:
    """Return (origins, directions with camera z = 1) of a grid of rays over the image, in the world."""
    u, v = np.meshgrid(np.linspace(0, width_px, GRID), np.linspace(0, height_px, GRID))
    fx, fy, cx, cy = intrinsics
    in_cam = np.stack([(u - cx) / fx, (v - cy) / fy, np.ones_like(u)], axis=-1).reshape(-1, 3)
    directions = in_cam @ world_from_cam[:3, :3].T
    return np.broadcast_to(world_from_cam[:3, 3], directions.shape), directions


def near_far(
    slab: Slab,
    world_from_cam: Float[np.ndarray, "4 4"],
    intrinsics: Float[np.ndarray, " 4"],
    size_px: tuple[int, int],
    seen_depths: Float[np.ndarray, " s"],
) -> Float[np.ndarray, " 2"]:
    """Return (near, far) along z: the slab's extent over the view, held within what the view is known to see.

    Without the second part, a view that shows the horizon would have no far at all.
    """
    nearest, farthest = np.quantile(seen_depths, [0.005, 0.995])
    origins, directions = edge_rays(world_from_cam, intrinsics, *size_px)
    bounds = (np.full(len(origins), 0.5 * nearest), np.full(len(origins), 1.5 * farthest))
    start, end = slab.span(origins, directions, *bounds)
    return np.array([start.min(), end.max()])


def depths_in(cam_from_world: Float[np.ndarray, "3 4"], points_in_world: Float[np.ndarray, "p 3"]) -> np.ndarray:
    """Return the distances along z of the points in front of a camera."""
    z = apply(cam_from_world, points_in_world)[:, 2]
    return z[z > 0]
