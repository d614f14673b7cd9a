"""Where views see the ground, and where points lie in views."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from aug3d_core.dataset.rays import Rays, pixel_centres, pixel_rays, view_rays
from aug3d_core.dataset.scene import Scene
from aug3d_core.geometry.transforms import invert

_SAMPLED = 1_000_000  # points of the ground, of all views together: 24 MB
_LEAST_A_SIDE = 8  # pixels of a view that are sampled, even where more are then held


def ground_points(scene: Scene, view: int) -> tuple[Float[np.ndarray, "r 3"], Bool[np.ndarray, " r"]]:
    """Return where the rays of a view's pixels meet the ground plane, and whether they do."""
    return _on_ground(scene, view_rays(scene, view, slab_bounds=False))


def sampled_ground(scene: Scene, views: Int[np.ndarray, " v"]) -> Float[np.ndarray, "p 3"]:
    """Return where pixels of views meet the ground: all pixels of a few views, of many a grid of some in each."""
    wanted = np.sqrt(len(views) * scene.width_px * scene.height_px / _SAMPLED)
    step = max(1, min(int(np.ceil(wanted)), scene.width_px // _LEAST_A_SIDE, scene.height_px // _LEAST_A_SIDE))
    centres = pixel_centres(scene.width_px, scene.height_px).reshape(scene.height_px, scene.width_px, 2)
    xy_px = centres[step // 2 :: step, step // 2 :: step].reshape(-1, 2)
    found = []
    for view in views:
        rays = pixel_rays(scene, np.full(len(xy_px), view), xy_px, slab_bounds=False)
        points, reached = _on_ground(scene, rays)
        found.append(points[reached])
    return np.concatenate(found)


def middle_ground(scene: Scene, view: int) -> Float[np.ndarray, " 3"]:
    """Return where the ray of an image's middle meets the ground, or a point ahead at the scene's usual distance."""
    middle = np.array([[scene.width_px / 2, scene.height_px / 2]])
    ray = pixel_rays(scene, np.array([view]), middle, slab_bounds=False)
    t = scene.slab.meet(ray.origins, ray.directions, 0.0)
    return (ray.origins + np.where(np.isfinite(t), t, scene.scale)[:, None] * ray.directions)[0]


def project(
    scene: Scene, view: int, points_in_world: Float[np.ndarray, "p 3"]
) -> tuple[Float[np.ndarray, "p 2"], Bool[np.ndarray, " p"]]:
    """Return the pixels of points in a view, and whether they are in front of it."""
    cam_from_world = invert(scene.world_from_cam[view][:3])
    in_cam = points_in_world @ cam_from_world[:, :3].T + cam_from_world[:, 3]
    ahead = in_cam[:, 2] > 1e-6
    fx, fy, cx, cy = scene.intrinsics[view]
    z = np.where(ahead, in_cam[:, 2], 1.0)
    return np.stack([in_cam[:, 0] / z * fx + cx, in_cam[:, 1] / z * fy + cy], axis=1), ahead


def shows(scene: Scene, view: int, points_in_world: Float[np.ndarray, "p 3"]) -> Bool[np.ndarray, " p"]:
    """Return which points lie in front of a view and within its image."""
    xy_px, ahead = project(scene, view, points_in_world)
    return ahead & ((xy_px >= 0) & (xy_px <= [scene.width_px, scene.height_px])).all(axis=1)


def _on_ground(scene: Scene, rays: Rays) -> tuple[Float[np.ndarray, "r 3"], Bool[np.ndarray, " r"]]:
    """Return where rays meet the ground plane, and whether they do."""
    t = scene.slab.meet(rays.origins, rays.directions, 0.0)
    reached = np.isfinite(t)
    return rays.origins + np.where(reached, t, 1.0)[:, None] * rays.directions, reached
