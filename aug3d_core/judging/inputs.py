"""Which photographs of a test group every answer is made from."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Int

from aug3d_core.dataset.scene import Scene
from aug3d_core.dataset.warp import Inputs, Target, on_device

_ASIDE = 20.0  # times 1 - cosine: seen from 18 degrees beside the target, a point counts 1/e
RULE = (
    "of a group's support views, one after another the one that adds most to what they see of the target, by the depth of the"
    f" scaffold there, a point weighing exp(-{_ASIDE:g} (1 - cos)) by the angle between the two lines of sight; the first ones"
    " where there is no scaffold"
)


def chosen_inputs(scene: Scene, target: int, support: Int[np.ndarray, " s"], count: int) -> Int[np.ndarray, " v"]:
    """Return so many of the support views, by RULE, in the order that they are given in."""
    if count >= len(support) or not scene.scaffold[target].any():
        return support[:count]
    device = torch.device("cpu")
    rays = Target.of(scene, target, (0, 0, scene.width_px, scene.height_px), device)
    cameras, depth = Inputs.of(scene, target, support, device), on_device(scene.scaffold[target], device)
    xy_px, inside = cameras.project(rays, depth[None])
    hidden = cameras.hidden(rays, depth, on_device(scene.scaffold[support], device)[:, None], xy_px)
    weight = torch.exp(_ASIDE * (cameras.cosines(rays, depth) - 1))
    worth = (weight * (inside[:, 0] & ~hidden & (depth > 0))).flatten(1).numpy()
    chosen: list[int] = []
    so_far = np.zeros(worth.shape[1])
    for _ in range(count):
        gained = np.maximum(worth - so_far, 0).sum(axis=1)
        gained[chosen] = -1
        chosen.append(int(gained.argmax()))
        so_far = np.maximum(so_far, worth[chosen[-1]])
    return support[sorted(chosen)]
