"""Group views by shared points: centres spread evenly over the scene, and the views that share most with each.

What two views share is told as a share: the count over the geometric mean of what each sees. A view from high up that
shares points with everybody (a hub) is then no one's nearest, and views full of texture are not favoured.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from aug3d_core.groups.config import GroupingConfig
from aug3d_core.groups.methods.similar import Likeness, group_by, lonely, most_similar
from aug3d_core.groups.scene import GroupingScene

OVERLAPS = 0.05  # Shared share from which two views overlap; `cluster_size.py` tells where the figure comes from


def group(
    scene: GroupingScene,
    candidates: Int[np.ndarray, " m"],
    k: int,
    count: int,
    config: GroupingConfig,
    rng: np.random.Generator,
) -> Int[np.ndarray, "c k"]:
    """Return the members of each group, centre first, then by shared points. Nothing is set or random here."""
    return group_by(likeness(scene), scene, candidates, k, count)


def excluded(scene: GroupingScene, candidates: Int[np.ndarray, " m"], k: int) -> dict[str, Int[np.ndarray, " x"]]:
    """Return the candidates that share too little with too many to be the centre of a group."""
    return {"it overlaps with too few others": lonely(likeness(scene), candidates, k)}


def most_shared(scene: GroupingScene, centre: int, candidates: Int[np.ndarray, " m"], k: int) -> Int[np.ndarray, " k"]:
    """Return a view and the k - 1 other candidates that share most points with it."""
    return most_similar(likeness(scene), scene, centre, candidates, k)


def likeness(scene: GroupingScene) -> Likeness:
    """Return the shared points as a share, and from when on they tell of overlap."""
    return Likeness(scene.shared_share, OVERLAPS)
