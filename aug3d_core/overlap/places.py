"""The groups that the pictures show: of every way those at the same few places on the ground."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Int

from aug3d_core.geometry.spread import farthest_points
from aug3d_core.groups.scene import GroupingScene
from aug3d_core.overlap.comparison import Grouped


def groups_at_places(
    scene: GroupingScene, grouped: Mapping[str, Grouped], places: int
) -> dict[str, Int[np.ndarray, "p k"]]:
    """Return for each way the group whose centre looks nearest to each place.

    The places are looked at by views spread over the ground, the first in the middle, and not chosen for any way's sake.
    """
    look = scene.look_in_world
    at = look[farthest_points(look, places)]
    chosen = {}
    for method, groups in grouped.items():
        away = np.linalg.norm(look[groups.members[:, 0]][None] - at[:, None], axis=2)
        chosen[method] = groups.members[np.argmin(away, axis=1)]
    return chosen
