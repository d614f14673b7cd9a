"""Rays and input views -> pixels, coarse and fine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from aug3d_core.dataset.rays import Rays
from aug3d_core.dataset.scene import Scene
from aug3d_core.geometry.transforms import invert
from aug3d_core.heads.exposure import Exposure
from aug3d_core.heads.pixelnerf import sampling
from aug3d_core.heads.pixelnerf.cameras import PIXELS, Cameras, Grid, lookup
from aug3d_core.heads.pixelnerf.compositing import Pixels, composite
from aug3d_core.heads.pixelnerf.config import PixelNerfConfig
from aug3d_core.heads.pixelnerf.encoder import ENCODERS, Encoded
from aug3d_core.heads.pixelnerf.field import Field, Seen, SeenPixels


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
    rgba: Float[Tensor, "g v h w 4"]
    exposure: Exposure | None  # None: the network is shown colours as they are
    coarse: Float[Tensor, "g v h2 w2 c"]
    fine: Float[Tensor, "g v h2 w2 c"]
    grid: Grid


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
        return cls(*(torch.from_numpy(part.astype(np.float32)).reshape(groups, -1, *part.shape[1:]) for part in parts))

    def to(self, device: torch.device) -> TensorRays:
        """Return them on a device."""
        return TensorRays(*(part.to(device) for part in (self.origins, self.directions, self.near, self.far)))


class PixelNeRF(nn.Module):
    """Encoder, coarse field and fine field."""

    def __init__(self, config: PixelNerfConfig) -> None:
        super().__init__()
        self.config = config
        self.encoder = ENCODERS[config.encoder](config)
        self.coarse = Field(config, self.encoder.channels)
        self.fine = Field(config, self.encoder.channels)
        self._encoded = Encoded()
        if config.encoder_frozen:
            self.encoder.requires_grad_(False)
        self.register_load_state_dict_post_hook(lambda *_: self._encoded.forget())

    @property
    def device(self) -> torch.device:
        """Where the parameters are."""
        return self.coarse.leave.weight.device

    def encode(self, scene: Scene, views: np.ndarray) -> Inputs:
        """Encode the input views (g v) of groups."""
        groups, count = views.shape
        rgb = self._tensor(scene.images[views]) / 255
        alpha = self._tensor(scene.alpha[views])[..., None] / 255
        exposure = Exposure.of(rgb, alpha) if self.config.even_exposure else None
        shown = rgb if exposure is None else exposure.even(rgb)
        maps = self._maps(scene, views.ravel(), shown.flatten(0, 1))
        coarse, fine = (field.project(maps).unflatten(0, (groups, count)) for field in (self.coarse, self.fine))
        cameras = Cameras(
            self._tensor(invert(scene.world_from_cam[views][..., :3, :])),
            self._tensor(scene.intrinsics[views]),
            scene.width_px,
            scene.height_px,
        )
        rgba = torch.cat([rgb, alpha], dim=-1)
        return Inputs(cameras, Place.of(scene), rgba, exposure, coarse, fine, self.encoder.grid)

    def _maps(self, scene: Scene, views: np.ndarray, rgb: Float[Tensor, "n h w 3"]) -> Float[Tensor, "n h2 w2 c"]:
        """Encode views; what a frozen encoder made of a view is kept, unless the view is shown otherwise in other groups."""
        if not self.config.encoder_frozen:
            return self._encode(rgb)
        with torch.no_grad():
            if self.config.even_exposure:
                return self._encode(rgb)
            return self._encoded.maps(scene, views, lambda new: self._encode(rgb[new]))

    def _encode(self, rgb: Float[Tensor, "n h w 3"]) -> Float[Tensor, "n h2 w2 c"]:
        """Encode images; channels stay last in memory throughout, as a lookup wants them."""
        return self.encoder((rgb * 2 - 1).movedim(-1, 1)).movedim(1, -1)

    def _tensor(self, array: np.ndarray) -> Tensor:
        return torch.from_numpy(np.ascontiguousarray(array, dtype=np.float32)).to(self.device)

    def forward(
        self, inputs: Inputs, rays: TensorRays, noise: torch.Generator | None, mixed: bool = False
    ) -> tuple[Pixels, Pixels]:
        """Render rays coarsely and finely (r = g * rays per group); without noise, always the same.

        mixed: let the fields compute in bfloat16; where points lie stays in float32, for it has to be known to a pixel's part.
        """
        rays, config = rays.to(self.device), self.config
        near, far = rays.near.flatten(), rays.far.flatten()
        t = sampling.stratified(near, far, self._noise(len(near), config.coarse_samples, noise))
        coarse = self._shade(self.coarse, inputs.coarse, inputs, rays, t, mixed)
        # A network gone to NaN must show in the loss, where it is caught, and not as an index out of range here.
        weights, depth = coarse.weights.detach().nan_to_num(), coarse.depth.detach().nan_to_num()
        borders = sampling.edges(t, near, far)
        added = [
            sampling.by_importance(borders, weights, self._noise(len(near), config.fine_samples, noise)),
            sampling.around_depth(depth, near, far, self._noise(len(near), config.depth_samples, noise)),
        ]
        t = torch.cat([t, *added], dim=1).sort(dim=1).values
        return coarse, self._shade(self.fine, inputs.fine, inputs, rays, t, mixed)

    def _shade(
        self, field: Field, maps: Tensor, inputs: Inputs, rays: TensorRays, t: Float[Tensor, "r s"], mixed: bool
    ) -> Pixels:
        groups, count = rays.near.shape
        samples = t.shape[1]
        steps = t.reshape(groups, count, samples, 1)
        points = (rays.origins[:, :, None] + steps * rays.directions[:, :, None]).flatten(1, 2)
        turned = inputs.cameras.directions_in_cam(F.normalize(rays.directions, dim=-1))
        turned = turned[:, :, :, None].expand(-1, -1, -1, samples, -1).flatten(2, 3)
        seen = self._look(maps, inputs, points, turned)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=mixed):
            colour, density = (part.float() for part in field(seen))
        if inputs.exposure is not None and not self.config.blend_inputs:  # what is blended has its own exposure
            colour = inputs.exposure.restore(colour)
        near, far = rays.near.flatten(), rays.far.flatten()
        unit = (inputs.place.high - inputs.place.low) / rays.directions.norm(dim=-1).flatten()
        lengths = sampling.edges(t, near, far).diff(dim=1) / unit[:, None]
        return composite(
            colour.reshape(-1, samples, 3), density.reshape(-1, samples), t, lengths, self.config.opaque_end
        )

    def _look(
        self, maps: Tensor, inputs: Inputs, points: Float[Tensor, "g p 3"], turned: Float[Tensor, "g v p 3"]
    ) -> Seen:
        """Gather what the input views know of points; `turned` are the rays' directions in the views' frames."""
        config, cameras = self.config, inputs.cameras
        in_cam = cameras.points_in_cam(points)
        xy_px, inside = cameras.project(in_cam)
        pixels, visible = None, None
        if config.see_pixels or config.blend_inputs or config.mask_unseen:
            rgba = lookup(xy_px, PIXELS, cameras.width_px, cameras.height_px)(inputs.rgba)
            cosine = (F.normalize(in_cam, dim=-1) * turned).sum(dim=-1)
            colour, exposure = rgba[..., :3], inputs.exposure
            shown = colour if exposure is None else exposure.even(colour)
            pixels = SeenPixels(colour, shown, cosine, fallback=inputs.rgba[..., :3].mean(dim=(1, 2, 3)))
            visible = inside & (rgba[..., 3] > 0.5) if config.mask_unseen else None
        return Seen(
            position=(cameras.directions_in_cam(points) if config.normalised_z else in_cam) / inputs.place.scale,
            direction=turned,
            height=inputs.place.height(points),
            features=lookup(xy_px, inputs.grid, maps.shape[-2], maps.shape[-3])(maps),
            visible=visible,
            pixels=pixels,
        )

    def _noise(self, rays: int, samples: int, generator: torch.Generator | None) -> Float[Tensor, "r s"]:
        if generator is None:
            return torch.full((rays, samples), 0.5, device=self.device)
        return torch.rand((rays, samples), generator=generator).to(self.device)
