"""Rays and input views -> pixels, coarse and fine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from aug3d_core.dataset.scene import Scene
from aug3d_core.geometry.transforms import invert
from aug3d_core.nerf import sampling
from aug3d_core.nerf.cameras import Cameras, lookup
from aug3d_core.nerf.compositing import Pixels, composite
from aug3d_core.nerf.config import TrainingConfig
from aug3d_core.nerf.encoder import ENCODERS
from aug3d_core.nerf.field import Field, Seen
from aug3d_core.nerf.rays import Rays


@dataclass(frozen=True)
class Place:
    """What of the scene the model needs beside views: the slab, and the unit of length of encoded positions."""

    plane: tuple[float, float, float]
    low: float
    high: float
    scale: float

    @classmethod
    def of(cls, scene: Scene) -> Place:
        """Take the scene's slab and scale."""
        slab = scene.slab
        return cls((slab.a, slab.b, slab.c), slab.low, slab.high, scene.scale)

    def height(self, points_in_world: Float[Tensor, "*n 3"]) -> Float[Tensor, "*n"]:
        """Return heights in the slab, 0 at its bottom and 1 at its top."""
        x, y, z = points_in_world.unbind(-1)
        a, b, c = self.plane
        return (z - (a * x + b * y + c) - self.low) / (self.high - self.low)


@dataclass(frozen=True)
class Inputs:
    """The input views of several groups, encoded: all that stays the same for every ray of them."""

    cameras: Cameras
    place: Place
    rgba: Float[Tensor, "g v 4 h w"]
    coarse: Float[Tensor, "g v c h2 w2"]
    fine: Float[Tensor, "g v c h2 w2"]
    stride: int


@dataclass(frozen=True)
class TensorRays:
    """Rays of several groups, r for each."""

    origins: Float[Tensor, "g r 3"]
    directions: Float[Tensor, "g r 3"]
    near: Float[Tensor, "g r"]
    far: Float[Tensor, "g r"]

    @classmethod
    def of(cls, rays: Rays, groups: int) -> TensorRays:
        """Take rays listed group after group."""
        parts = (rays.origins, rays.directions, rays.near, rays.far)
        return cls(*(_tensor(part).reshape(groups, -1, *part.shape[1:]) for part in parts))


class PixelNeRF(nn.Module):
    """Encoder, coarse field and fine field."""

    def __init__(self, config: TrainingConfig) -> None:
        super().__init__()
        self.config = config
        self.encoder = ENCODERS[config.encoder](config.encoder_channels)
        self.coarse = Field(config, self.encoder.channels)
        self.fine = Field(config, self.encoder.channels)

    def encode(self, scene: Scene, views: np.ndarray) -> Inputs:
        """Encode the input views (g v) of groups."""
        groups, count = views.shape
        rgb = _tensor(scene.images[views]).movedim(-1, 2) / 255
        alpha = _tensor(scene.alpha[views])[:, :, None] / 255
        maps = self.encoder((rgb * 2 - 1).flatten(0, 1))
        coarse, fine = (field.project(maps).unflatten(0, (groups, count)) for field in (self.coarse, self.fine))
        cameras = Cameras(
            _tensor(invert(scene.world_from_cam[views][..., :3, :])),
            _tensor(scene.intrinsics[views]),
            scene.width_px,
            scene.height_px,
        )
        return Inputs(cameras, Place.of(scene), torch.cat([rgb, alpha], dim=2), coarse, fine, self.encoder.stride)

    def forward(self, inputs: Inputs, rays: TensorRays, noise: torch.Generator | None) -> tuple[Pixels, Pixels]:
        """Render rays coarsely and finely (r = g * rays per group); without noise, always the same."""
        near, far = rays.near.flatten(), rays.far.flatten()
        config = self.config
        t = sampling.stratified(near, far, _noise(len(near), config.coarse_samples, noise))
        coarse = self._shade(self.coarse, inputs.coarse, inputs, rays, t)
        # A network gone to NaN must show in the loss, where it is caught, and not as an index out of range here.
        weights, depth = coarse.weights.detach().nan_to_num(), coarse.depth.detach().nan_to_num()
        borders = sampling.edges(t, near, far)
        added = [
            sampling.by_importance(borders, weights, _noise(len(near), config.fine_samples, noise)),
            sampling.around_depth(depth, near, far, _noise(len(near), config.depth_samples, noise)),
        ]
        t = torch.cat([t, *added], dim=1).sort(dim=1).values
        return coarse, self._shade(self.fine, inputs.fine, inputs, rays, t)

    def _shade(self, field: Field, maps: Tensor, inputs: Inputs, rays: TensorRays, t: Float[Tensor, "r s"]) -> Pixels:
        groups, count = rays.near.shape
        samples = t.shape[1]
        steps = t.reshape(groups, count, samples, 1)
        points = (rays.origins[:, :, None] + steps * rays.directions[:, :, None]).flatten(1, 2)
        directions = F.normalize(rays.directions, dim=-1)[:, :, None].expand(-1, -1, samples, -1).flatten(1, 2)
        colour, density = field(_look(maps, inputs, points, directions))
        near, far = rays.near.flatten(), rays.far.flatten()
        unit = (inputs.place.high - inputs.place.low) / rays.directions.norm(dim=-1).flatten()
        lengths = sampling.edges(t, near, far).diff(dim=1) / unit[:, None]
        return composite(
            colour.reshape(-1, samples, 3), density.reshape(-1, samples), t, lengths, self.config.opaque_end
        )


def _look(maps: Tensor, inputs: Inputs, points: Float[Tensor, "g p 3"], directions: Float[Tensor, "g p 3"]) -> Seen:
    """Gather what the input views know of points."""
    cameras = inputs.cameras
    in_cam = cameras.points_in_cam(points)
    turned = cameras.directions_in_cam(directions)
    xy_px, inside = cameras.project(in_cam)
    features = lookup(xy_px, inputs.stride, maps.shape[-1], maps.shape[-2])(maps)
    rgba = lookup(xy_px, 1, cameras.width_px, cameras.height_px)(inputs.rgba)
    return Seen(
        position=in_cam / inputs.place.scale,
        direction=turned,
        cosine=(F.normalize(in_cam, dim=-1) * turned).sum(dim=-1),
        height=inputs.place.height(points),
        features=features,
        colour=rgba[..., :3],
        visible=inside & (rgba[..., 3] > 0.5),
        fallback=inputs.rgba[:, :, :3].mean(dim=(1, 3, 4)),
    )


def _noise(rays: int, samples: int, generator: torch.Generator | None) -> Float[Tensor, "r s"]:
    if generator is None:
        return torch.full((rays, samples), 0.5)
    return torch.rand((rays, samples), generator=generator)


def _tensor(array: np.ndarray) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(array, dtype=np.float32))
