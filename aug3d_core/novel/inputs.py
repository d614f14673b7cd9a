"""Which photographs a view is predicted from where it has no scaffold yet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.dataset.new_views import only
from aug3d_core.dataset.projection import ground_points, middle_ground, shows
from aug3d_core.dataset.rays import view_rays
from aug3d_core.dataset.scene import Scene
from aug3d_core.judging.inputs import chosen_inputs

_NEAR = 24  # photographs that look nearest to a view: of these its inputs are chosen


def inputs_of(scene: Scene, target: int, photos: Int[np.ndarray, " p"], count: int) -> Int[np.ndarray, " v"]:
    """Return those of the photographs that add most to what is seen of a view's ground, as the test has it over a scaffold."""
    spots = np.stack([middle_ground(scene, int(view)) for view in photos])
    away = np.linalg.norm(spots - middle_ground(scene, target), axis=1)
    support = most_alike(scene, target, photos[np.argsort(away, kind="stable")[:_NEAR]])
    rows = np.append(target, support)
    over_ground = only(scene, rows)
    ground = [_ground_depth(over_ground, view) for view in range(len(rows))]
    over_ground = replace(over_ground, scaffold=np.stack(ground).astype(np.float16))
    return rows[chosen_inputs(over_ground, 0, np.arange(1, len(rows)), count)]


def _ground_depth(scene: Scene, view: int) -> Float[np.ndarray, "h w"]:
    """Return the depth of the ground plane in a view, as far as a scaffold can tell; 0 where it shows none."""
    rays = view_rays(scene, view, slab_bounds=False)
    depth = scene.slab.meet(rays.origins, rays.directions, 0.0)
    depth = np.where(np.isfinite(depth), np.minimum(depth, np.finfo(np.float16).max), 0.0)
    return depth.reshape(scene.height_px, scene.width_px)


def most_alike(scene: Scene, view: int, photos: Int[np.ndarray, " p"]) -> Int[np.ndarray, " p"]:
    """Order photographs by the share of a view's ground that they show, in whole percents; the nearer camera first."""
    ground, reached = ground_points(scene, view)
    percent = np.array([np.round(100 * (reached & shows(scene, int(photo), ground)).mean()) for photo in photos])
    away = np.linalg.norm(scene.world_from_cam[photos, :3, 3] - scene.world_from_cam[view, :3, 3], axis=1)
    return photos[np.lexsort((away, -percent))]
