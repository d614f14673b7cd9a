"""Where tiles of ground meet, and what lies near."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Bool, Float

from aug3d_core.geometry.ground_tiles import Halved, Planned


def halvings(plan: Halved | Planned) -> Iterator[Halved]:
    """Yield the borders of a plan."""
    if isinstance(plan, Halved):
        yield plan
        yield from halvings(plan.below)
        yield from halvings(plan.above)


def near_border(xyz: Float[np.ndarray, "p 3"], plan: Halved | Planned, within: float) -> Bool[np.ndarray, " p"]:
    """Tell which points are so near (world units) to a border on the ground's plane."""
    near = np.zeros(len(xyz), bool)
    for border in halvings(plan):
        near |= (np.abs(xyz[:, border.axis] - border.at) <= within) & border.ground.holds(xyz)
    return near
