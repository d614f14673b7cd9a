"""The paper's network written plainly: per point and per view, every layer where the paper has it, no savings.

It computes with the weights of a `PixelNeRF` what that computes, so that tests can compare the two and a benchmark can
say what the savings save. It knows the paper's network only: a configuration that differs from it is refused.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional as F

from aug3d_core.dataset.scene import Scene
from aug3d_core.geometry.transforms import invert
from aug3d_core.heads.pixelnerf import sampling
from aug3d_core.heads.pixelnerf.compositing import Pixels, composite
from aug3d_core.heads.pixelnerf.field import Field, encode
from aug3d_core.heads.pixelnerf.model import PixelNeRF, TensorRays

_NOT_THE_PAPERS = ("see_pixels", "even_exposure", "mask_unseen", "blend_inputs", "encode_height", "opaque_end")


def encode_plainly(model: PixelNeRF, scene: Scene, views: np.ndarray) -> Float[Tensor, "gv c h w"]:
    """Encode the input views (g v) of groups."""
    images = torch.from_numpy(scene.images[views].astype(np.float32)).movedim(-1, 2) / 255
    return model.encoder((images * 2 - 1).flatten(0, 1))


def render_plainly(
    model: PixelNeRF,
    scene: Scene,
    views: np.ndarray,
    maps: Float[Tensor, "gv c h w"],
    rays: TensorRays,
    noise: torch.Generator | None,
) -> tuple[Pixels, Pixels]:
    """Render rays of groups coarsely and finely from their encoded input views (g v), as `PixelNeRF` does."""
    config = model.config
    different = [name for name in _NOT_THE_PAPERS if getattr(config, name)]
    assert not different, f"the reference does not know {', '.join(different)}"
    near, far = rays.near.flatten(), rays.far.flatten()
    t = sampling.stratified(near, far, _noise(len(near), config.coarse_samples, noise))
    coarse = _shade(model, model.coarse, maps, scene, views, rays, t)
    borders = sampling.edges(t, near, far)
    importance = _noise(len(near), config.fine_samples, noise)
    t_fine = sampling.by_importance(borders, coarse.weights.detach(), importance)
    around = _noise(len(near), config.depth_samples, noise)
    t_depth = sampling.around_depth(coarse.depth.detach(), near, far, around)
    t = torch.cat([t, t_fine, t_depth], dim=1).sort(dim=1).values
    return coarse, _shade(model, model.fine, maps, scene, views, rays, t)


def _shade(
    model: PixelNeRF, field: Field, maps: Tensor, scene: Scene, views: np.ndarray, rays: TensorRays, t: Tensor
) -> Pixels:
    near, far = rays.near.flatten(), rays.far.flatten()
    directions = F.normalize(rays.directions, dim=-1)
    points = rays.origins[:, :, None] + t.reshape(*rays.near.shape, -1)[..., None] * rays.directions[:, :, None]
    colours, densities = [], []
    for group, members in enumerate(views):
        each = [
            _one_view(
                model, field, maps[group * len(members) + place], scene, int(view), points[group], directions[group]
            )
            for place, view in enumerate(members)
        ]
        x = torch.stack(each).mean(dim=0)
        for block in field.pooled:
            x = block(x)
        out = field.leave(F.relu(x))
        colours.append(torch.sigmoid(out[..., :3]))
        densities.append(F.relu(out[..., 3]))
    unit = (scene.slab.high - scene.slab.low) / rays.directions.norm(dim=-1).flatten()
    lengths = sampling.edges(t, near, far).diff(dim=1) / unit[:, None]
    return composite(torch.cat(colours), torch.cat(densities), t, lengths, opaque_end=False)


def _one_view(
    model: PixelNeRF,
    field: Field,
    maps: Float[Tensor, "c h w"],
    scene: Scene,
    view: int,
    points: Float[Tensor, "r s 3"],
    directions: Float[Tensor, "r 3"],
) -> Float[Tensor, "r s width"]:
    """Look at points from one input view, up to where the views are averaged."""
    config = model.config
    cam_from_world = torch.from_numpy(invert(scene.world_from_cam[view][:3]).astype(np.float32))
    fx, fy, cx, cy = scene.intrinsics[view].astype(np.float32)
    turned = points @ cam_from_world[:, :3].T
    in_cam = turned + cam_from_world[:, 3]
    depth = torch.where(in_cam[..., 2:] > 1e-6, in_cam[..., 2:], torch.ones_like(in_cam[..., 2:]))
    xy_px = in_cam[..., :2] / depth * torch.tensor([fx, fy]) + torch.tensor([cx, cy])
    grid, (rows, columns) = model.encoder.grid, maps.shape[1:]
    place = (xy_px - grid.first_px) / grid.stride_px
    at = place / (torch.tensor([columns, rows]) - 1) * 2 - 1
    features = F.grid_sample(maps[None], at[None], padding_mode="border", align_corners=True)[0].movedim(0, -1)
    where = encode((turned if config.normalised_z else in_cam) / scene.scale, config.frequencies)
    seen_along = (directions @ cam_from_world[:, :3].T)[:, None].expand(-1, points.shape[1], -1)
    x = field.enter(torch.cat([*where, seen_along], dim=-1))
    weights = field.features.weight.split(config.hidden)
    for block, weight, bias in zip(field.per_view, weights, field.features.bias.split(config.hidden), strict=True):
        x = block(x + F.linear(features, weight, bias))
    return x


def _noise(rays: int, samples: int, generator: torch.Generator | None) -> Float[Tensor, "r s"]:
    if generator is None:
        return torch.full((rays, samples), 0.5)
    return torch.rand((rays, samples), generator=generator)
