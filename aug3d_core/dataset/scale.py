"""The scale of a scene: how far the ground usually is from its photographs' cameras."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from aug3d_core.dataset.bounds import edge_rays
from aug3d_core.dataset.slab import Slab


def ground_distance(
    slab: Slab,
    world_from_cam: Float[np.ndarray, "n 4 4"],
    intrinsics: Float[np.ndarray, "n 4"],
    near_far: Float[np.ndarray, "n 2"],
    size_px: tuple[int, int],
) -> float:
    """Return the median distance along z from the photographs' cameras to the ground in their images' middle.

    Images whose middle shows no ground do not count; if none does, it is the median of the far bounds. size_px: width, height.
    """
    middle = []
    for pose, lens in zip(world_from_cam, intrinsics, strict=True):
        origins, directions = edge_rays(pose, lens, *size_px)
        middle.append(slab.meet(origins, directions, 0.0)[len(origins) // 2])
    reached = [t for t in middle if np.isfinite(t)]
    return float(np.median(reached)) if reached else float(np.median(near_far[:, 1]))
