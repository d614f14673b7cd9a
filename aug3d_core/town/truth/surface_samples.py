"""Points spread evenly over a mesh, and which of them photographs frame."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import apply, project
from aug3d_core.geometry.views import Views


def sample_surface(mesh: Mesh, count: int, rng: np.random.Generator) -> Float[np.ndarray, "n 3"]:
    """Return `count` points of equal density per area, in float64; none if the mesh has no area."""
    a, b, c = (mesh.xyz[mesh.triangles[:, corner]].astype(float) for corner in range(3))
    area_up_to = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1))
    if not len(area_up_to) or area_up_to[-1] <= 0:
        return np.empty((0, 3))
    # One draw per equal slice of the area: less scatter than draws that know nothing of one another.
    at = (np.arange(count) + rng.random(count)) / count * area_up_to[-1]
    chosen = np.searchsorted(area_up_to, at, side="right").clip(max=len(area_up_to) - 1)
    u, v = rng.random((2, count, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    return a[chosen] + u * (b[chosen] - a[chosen]) + v * (c[chosen] - a[chosen])


def framed(points: Float[np.ndarray, "p 3"], views: Views, view: int) -> Bool[np.ndarray, " p"]:
    """Tell which points lie in front of a view and inside its frame, hidden or not."""
    in_cam = apply(views.cam_from_world[view], points)
    ahead = in_cam[:, 2] > 1e-9
    xy = project(np.where(ahead[:, None], in_cam, 1.0), views.intrinsics[view])
    return ahead & ((xy >= 0) & (xy <= views.size[view])).all(axis=1)
