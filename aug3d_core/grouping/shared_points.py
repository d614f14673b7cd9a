"""Group views by shared points: centres spread evenly over the scene, and the views that share most with each."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from aug3d_core.grouping.scene import GroupingScene
from aug3d_core.grouping.spread import farthest_points


def group(
    scene: GroupingScene, candidates: Int[np.ndarray, " m"], k: int, count: int, rng: np.random.Generator
) -> Int[np.ndarray, "c k"]:
    """Return the members of each group, centre first, then by shared points. Nothing is random: `rng` is not used."""
    centres = candidates[farthest_points(scene.look_in_world[candidates], count)]
    return np.stack([most_shared(scene, centre, candidates, k) for centre in centres.tolist()])


def most_shared(scene: GroupingScene, centre: int, candidates: Int[np.ndarray, " m"], k: int) -> Int[np.ndarray, " k"]:
    """Return a view and the k - 1 other candidates that share most points with it.

    Among equals, and so among those that share nothing, the one that looks nearest comes first, then the earlier photo.
    """
    others = candidates[candidates != centre]
    shared = scene.shared[[centre]].toarray()[0, others]
    away = np.linalg.norm(scene.look_in_world[others] - scene.look_in_world[centre], axis=1)
    order = np.lexsort((scene.views.photo_id[others], away, -shared))
    return np.concatenate([[centre], others[order[: k - 1]]])
