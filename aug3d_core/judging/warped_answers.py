"""Cheap answers that move the inputs' pixels to where geometry says, without learning (in torch, as heads do).

plane_sweep   the depth at which the inputs agree best, that of the ground where fewer than two see any
guided_blend  the depth of a mesh that was made without the target, and its colour where no input sees
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor
from torch.nn import functional as F

from aug3d_core.dataset.scene import Scene
from aug3d_core.dataset.warp import Inputs, Target, fine_colours, lookup, on_device
from aug3d_core.heads.head import to_8_bit

# No other window of 5 to 13 px, and no 0.01, makes the sweep stronger by more than 0.1 dB over three scenes (docs/trials.md)
PLANES, WINDOW_PX = 64, 9
_SOFT = 0.003  # difference of colours in [0, 1] that makes a plane e times less likely
_UNSEEN = 1.0  # in place of a difference, where fewer than two inputs see a plane
_LEAST_ANGLE = 0.01  # added to 1 - cosine
_CPU = torch.device("cpu")


@torch.inference_mode()
def plane_sweep(scene: Scene, target: int, inputs: Int[np.ndarray, " v"]) -> UInt8[np.ndarray, "h w 3"]:
    """Return the inputs' colours where planes between the slab's bottom and top make them agree best."""
    rays, cameras, rgba, fine = _seen(scene, target, inputs)
    off = torch.stack([_disagreement(rays, cameras, rgba, height) for height in _heights()])
    cost = F.avg_pool2d(off[:, None], WINDOW_PX, 1, WINDOW_PX // 2, count_include_pad=False)[:, 0]
    share = (-cost / _SOFT).softmax(dim=0)
    height = (share * _heights()[:, None, None]).sum(dim=0)
    # Else the middle of the slab would stand there, above the roofs
    height = torch.where((off < _UNSEEN).any(dim=0), height, _ground(scene))
    colour, _ = _blend(rays, cameras, rgba, fine, rays.depth_at(height), None)
    return to_8_bit(colour.movedim(0, -1).numpy())


@torch.inference_mode()
def guided_blend(scene: Scene, target: int, inputs: Int[np.ndarray, " v"]) -> UInt8[np.ndarray, "h w 3"]:
    """Return the inputs' colours at the depth of the scaffold, from inputs that it does not hide."""
    rays, cameras, rgba, fine = _seen(scene, target, inputs)
    depth = on_device(scene.scaffold[target], _CPU)
    scaffolds = on_device(scene.scaffold[inputs], _CPU)[:, None]
    there = torch.where(depth > 0, depth, rays.depth_at(torch.full_like(depth, 0.5)))
    colour, seen = _blend(rays, cameras, rgba, fine, there, scaffolds)
    answer = to_8_bit(colour.movedim(0, -1).numpy())
    row = int(np.flatnonzero(scene.baseline_view == target)[0])
    bare = ~(seen & (depth > 0)).numpy() & (scene.baseline_alpha[row] >= 128)
    answer[bare] = scene.baseline_images[row][bare]
    return answer


def _seen(
    scene: Scene, target: int, inputs: np.ndarray
) -> tuple[Target, Inputs, Float[Tensor, "v 4 y x"], Float[Tensor, "v 3 y2 x2"]]:
    rgba = np.concatenate([scene.images[inputs], scene.alpha[inputs][..., None]], axis=-1) / 255
    window = (0, 0, scene.width_px, scene.height_px)
    return (
        Target.of(scene, target, window, _CPU),
        Inputs.of(scene, target, inputs, _CPU),
        on_device(rgba, _CPU).movedim(-1, 1).contiguous(),
        on_device(scene.fine(inputs) / 255, _CPU).movedim(-1, 1).contiguous(),
    )


def _heights() -> Float[Tensor, " p"]:
    return (torch.arange(PLANES) + 0.5) / PLANES


def _ground(scene: Scene) -> float:
    """Return the height of the ground as a share of the slab."""
    return -scene.slab.low / (scene.slab.high - scene.slab.low)


def _disagreement(
    rays: Target, cameras: Inputs, rgba: Float[Tensor, "v 4 y x"], height: Float[Tensor, ""]
) -> Float[Tensor, "h w"]:
    """Return the mean absolute difference of the views that see a plane from their mean; _UNSEEN where fewer than two do."""
    xy_px, inside = cameras.project(rays, rays.depth_at(height.expand(1, *rays.rise.shape)))
    pixels = lookup(rgba, xy_px, 1)[:, :, 0]
    seen = (inside[:, 0] & (pixels[:, 3] > 0.5)).float()[:, None]
    count = seen.sum(dim=0)
    mean = (pixels[:, :3] * seen).sum(dim=0) / count.clamp(min=1)
    off = ((pixels[:, :3] - mean).abs().mean(dim=1, keepdim=True) * seen).sum(dim=0) / count.clamp(min=1)
    return torch.where(count > 1, off, torch.full_like(off, _UNSEEN))[0]


def _blend(
    rays: Target,
    cameras: Inputs,
    rgba: Float[Tensor, "v 4 y x"],
    fine: Float[Tensor, "v 3 y2 x2"],
    depth: Float[Tensor, "h w"],
    scaffolds: Float[Tensor, "v 1 y x"] | None,
) -> tuple[Float[Tensor, "3 h w"], Bool[Tensor, "h w"]]:
    """Return the inputs' mean colour at a depth, weighted by viewing angle, and where any input sees it."""
    xy_px, inside = cameras.project(rays, depth[None])
    pixels = lookup(rgba, xy_px, 1)[:, :, 0]
    seen = inside[:, 0] & (pixels[:, 3] > 0.5)
    if scaffolds is not None:
        seen = seen & ~cameras.hidden(rays, depth, scaffolds, xy_px)
    weight = (seen + 1e-6) / (1 - cameras.cosines(rays, depth) + _LEAST_ANGLE)
    colours = fine_colours(rays, cameras, fine, rays.height_of(depth))
    return (colours * (weight / weight.sum(dim=0))[:, None]).sum(dim=0), seen.any(dim=0)
