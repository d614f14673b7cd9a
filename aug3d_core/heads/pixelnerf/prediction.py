"""Predict a whole view from posed photographs, the same every time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, UInt8

from aug3d_core.dataset.rays import Rays, view_rays
from aug3d_core.dataset.scene import Scene
from aug3d_core.heads.pixelnerf.model import PixelNeRF, TensorRays


@dataclass(frozen=True)
class Prediction:
    """A predicted view; depth is the expected distance along z."""

    coarse: UInt8[np.ndarray, "h w 3"]
    fine: UInt8[np.ndarray, "h w 3"]
    depth: Float[np.ndarray, "h w"]


@torch.inference_mode()
def predict(model: PixelNeRF, scene: Scene, target: int, inputs: np.ndarray, rays_per_batch: int) -> Prediction:
    """Render the camera of view `target` from the views `inputs`; the target's pixels are not looked at."""
    encoded = model.encode(scene, inputs[None])
    rays = view_rays(scene, target, model.config.slab_bounds)
    parts = []
    for start in range(0, len(rays.near), rays_per_batch):
        end = start + rays_per_batch
        some = Rays(rays.origins[start:end], rays.directions[start:end], rays.near[start:end], rays.far[start:end])
        coarse, fine = model(encoded, TensorRays.of(some, 1), None)
        parts.append(tuple(part.cpu().numpy() for part in (coarse.colour, fine.colour, fine.depth)))
    coarse_rgb, fine_rgb, depth = (np.concatenate(part) for part in zip(*parts, strict=True))
    shape = (scene.height_px, scene.width_px)
    return Prediction(
        to_8_bit(coarse_rgb).reshape(*shape, 3), to_8_bit(fine_rgb).reshape(*shape, 3), depth.reshape(shape)
    )


def to_8_bit(rgb: Float[np.ndarray, "*n"]) -> UInt8[np.ndarray, "*n"]:
    """Round colours in [0, 1] to 8 bits, as every answer is before it is scored."""
    return np.clip(np.rint(rgb * 255), 0, 255).astype(np.uint8)
