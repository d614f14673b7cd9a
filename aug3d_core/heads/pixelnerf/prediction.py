"""Predict a whole view, some rays at a time."""

from __future__ import annotations

import numpy as np
import torch

from aug3d_core.dataset.rays import Rays, view_rays
from aug3d_core.dataset.scene import Scene
from aug3d_core.heads.head import View, to_8_bit
from aug3d_core.heads.pixelnerf.config import PixelNerfConfig
from aug3d_core.heads.pixelnerf.model import PixelNeRF, TensorRays

_VALUES_AT_A_TIME = 2**20  # of one layer of the field, for each input view


@torch.inference_mode()
def predict(model: PixelNeRF, scene: Scene, target: int, inputs: np.ndarray) -> View:
    """Render the camera of view `target` from the views `inputs`. The depth is the expected one."""
    encoded = model.encode(scene, inputs[None])
    rays = view_rays(scene, target, model.config.slab_bounds)
    count, parts = rays_at_a_time(model.config), []
    for start in range(0, len(rays.near), count):
        end = start + count
        some = Rays(rays.origins[start:end], rays.directions[start:end], rays.near[start:end], rays.far[start:end])
        coarse, fine = model(encoded, TensorRays.of(some, 1), None)
        parts.append(tuple(part.cpu().numpy() for part in (coarse.colour, fine.colour, fine.depth)))
    coarse_rgb, fine_rgb, depth = (np.concatenate(part) for part in zip(*parts, strict=True))
    shape = (scene.height_px, scene.width_px)
    return View(
        to_8_bit(fine_rgb).reshape(*shape, 3),
        depth.reshape(shape),
        parts={"coarse": to_8_bit(coarse_rgb).reshape(*shape, 3)},
    )


def rays_at_a_time(config: PixelNerfConfig) -> int:
    """Return a power of two of rays whose layers fit in memory, whatever the size of the network."""
    values = (config.coarse_samples + config.fine_samples + config.depth_samples) * config.hidden
    return 2 ** max((_VALUES_AT_A_TIME // values).bit_length() - 1, 0)
