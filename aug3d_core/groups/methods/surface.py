"""Group views by the surface that they see, found by rays on the SfM points themselves (our own way).

As with shared points, but neither does texture count nor what matching missed: similarity is a share of the picture, and
comes close to the true overlap.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from aug3d_core.groups.config import GroupingConfig
from aug3d_core.groups.methods.similar import Likeness, group_by, lonely
from aug3d_core.groups.scene import GroupingScene

_OVERLAPS = 0.15  # a true overlap of a tenth, and what the size of the cubes adds to it


def group(
    scene: GroupingScene,
    candidates: Int[np.ndarray, " m"],
    k: int,
    count: int,
    config: GroupingConfig,
    rng: np.random.Generator,
) -> Int[np.ndarray, "c k"]:
    """Return the members of each group, centre first, then by seen surface. Nothing is set or random here."""
    return group_by(Likeness(scene.seen_share, _OVERLAPS), scene, candidates, k, count)


def excluded(scene: GroupingScene, candidates: Int[np.ndarray, " m"], k: int) -> dict[str, Int[np.ndarray, " x"]]:
    """Return the candidates that see the same as too few others to be the centre of a group."""
    alone = lonely(Likeness(scene.seen_share, _OVERLAPS), candidates, k)
    return {"it overlaps with too few others": alone}
