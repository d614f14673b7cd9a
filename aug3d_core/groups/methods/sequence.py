"""Group views by the order of capture: runs of K, however the camera turned meanwhile (the paper's first way)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from aug3d_core.groups.config import GroupingConfig
from aug3d_core.groups.scene import GroupingScene


def group(
    scene: GroupingScene,
    candidates: Int[np.ndarray, " m"],
    k: int,
    count: int,
    config: GroupingConfig,
    rng: np.random.Generator,
) -> Int[np.ndarray, "c k"]:
    """Return runs that cover the candidates, the middle of each first; the last runs share views where K does not divide.

    With fewer groups than runs, those kept are spread evenly over the capture. Nothing is set or random here.
    """
    runs = -(-len(candidates) // k)
    starts = np.rint(np.linspace(0, len(candidates) - k, runs)).astype(int)
    kept = starts[np.rint(np.linspace(0, runs - 1, min(count, runs))).astype(int)]
    in_order = candidates[np.argsort(scene.views.photo_id[candidates], kind="stable")]
    middle_first = np.argsort(np.abs(np.arange(k) - k // 2), kind="stable")
    return in_order[kept[:, None] + middle_first]
