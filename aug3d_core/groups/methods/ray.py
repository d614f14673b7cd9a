"""Group views by where their central rays meet the ground (the paper's third way).

The paper took the height over flat ground from a few hand-picked photographs; here the ground is fitted to the points.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.geometry.spread import farthest_points
from aug3d_core.geometry.transforms import centres
from aug3d_core.groups.config import GroupingConfig
from aug3d_core.groups.scene import GroupingScene
from aug3d_core.run.errors import InputError

_EDGE_PERCENT = 1.0  # of the points on each side do not count for how far the scene reaches
_MARGIN = 0.25  # of the scene's size: rays may end so far beyond


def group(
    scene: GroupingScene,
    candidates: Int[np.ndarray, " m"],
    k: int,
    count: int,
    config: GroupingConfig,
    rng: np.random.Generator,
) -> Int[np.ndarray, "c k"]:
    """Return centres spread over the ends of the rays, and with each the K - 1 views whose rays end nearest.

    Views whose ray ends nowhere in the scene are in no group; raises InputError where fewer than K others are left, or
    no ground is found. Nothing is set or random here.
    """
    ends = ground_ends(scene)[candidates]
    hit = np.isfinite(ends[:, 0])
    if hit.sum() < k:
        raise InputError(
            f"{hit.sum()} of {len(candidates)} central rays meet the ground within the scene, and a group needs {k}",
            "Set grouping.method to shared.",
        )
    ends, views = ends[hit], candidates[hit]
    rows = []
    for centre in farthest_points(ends[:, :2], count):
        away = np.linalg.norm(ends - ends[centre], axis=1)
        away[centre] = -1.0
        rows.append(views[np.lexsort((scene.views.photo_id[views], away))[:k]])
    return np.stack(rows)


def excluded(scene: GroupingScene, candidates: Int[np.ndarray, " m"], k: int) -> dict[str, Int[np.ndarray, " x"]]:
    """Return the candidates whose ray ends nowhere in the scene."""
    missing = np.isnan(ground_ends(scene)[candidates, 0])
    return {"its central ray meets no ground within the scene": candidates[missing]}


def ground_ends(scene: GroupingScene) -> Float[np.ndarray, "n 3"]:
    """Return where the central ray of each view meets the ground; NaN at or above the horizon, and outside the scene."""
    views = scene.views
    central = (views.size / 2 - views.intrinsics[:, 2:]) / views.intrinsics[:, :2]
    in_cam = np.column_stack([central, np.ones(len(views))])
    directions = np.einsum("nij,ni->nj", views.cam_from_world[:, :, :3], in_cam)
    eyes = centres(views.cam_from_world)
    distance = scene.ground.meet(eyes, directions)
    ends = eyes + np.where(np.isfinite(distance), distance, np.nan)[:, None] * directions
    low, high = np.percentile(scene.points_in_world[:, :2], [_EDGE_PERCENT, 100 - _EDGE_PERCENT], axis=0)
    margin = _MARGIN * (high - low)
    inside = ((ends[:, :2] >= low - margin) & (ends[:, :2] <= high + margin)).all(axis=1)
    return np.where(inside[:, None], ends, np.nan)
