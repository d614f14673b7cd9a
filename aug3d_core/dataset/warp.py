"""The rays of a target, where points on them lie in the input views, and what these show there (in torch).

Everything is relative to the target's camera centre, so that single precision suffices however far off the world's origin
is. A point is centre + t ray; rays have camera z = 1, so that t is the depth. A height is a share of the slab: 0 at its bottom.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor
from torch.nn import functional as F

from aug3d_core.dataset.scene import FINER, Scene
from aug3d_core.geometry.transforms import invert

_LEAST_DEPTH = 1e-3  # of the distance to the ground
_HIDDEN = 1.02  # times as far as its own scaffold says: a view does not see a point


@dataclass(frozen=True)
class Target:
    """A window of a target's image as rays from its centre, and the slab above and below it.

    rise: how fast a ray gains height, in slabs per unit of t. height: of the camera.
    """

    rays: Float[Tensor, "h w 3"]
    rise: Float[Tensor, "h w"]
    height: float
    far: float

    @classmethod
    def of(cls, scene: Scene, view: int, window: tuple[int, int, int, int], device: torch.device) -> Target:
        """Take the window (left, top, width, height) of a view [px]."""
        left, top, width, height = window
        fx, fy, cx, cy = scene.intrinsics[view]
        turn, slab = scene.world_from_cam[view, :3, :3], scene.slab
        # A ray is what its column gives and what its row gives, added: few numbers go to the device
        columns = (left + np.arange(width) + 0.5 - cx)[:, None] / fx * turn[:, 0]
        rows = (top + np.arange(height) + 0.5 - cy)[:, None] / fy * turn[:, 1] + turn[:, 2]
        thickness = slab.high - slab.low
        up = np.array([-slab.a, -slab.b, 1]) / thickness
        rays, rise = (
            on_device(of_rows, device)[:, None] + on_device(of_columns, device)
            for of_rows, of_columns in ((rows, columns), (rows @ up, columns @ up))
        )
        above = (float(slab.height(scene.world_from_cam[view, :3, 3])) - slab.low) / thickness
        far = 2 * float(scene.near_far[view, 1])
        return cls(rays, rise, above, far)

    def at_stride(self, stride: int) -> Target:
        """Return the rays in the middle of squares of so many pixels."""
        rays = _pooled(self.rays.movedim(-1, 0), stride).movedim(0, -1)
        return Target(rays, _pooled(self.rise[None], stride)[0], self.height, self.far)

    def finer(self) -> Target:
        """Return the rays through FINER x FINER parts of each pixel."""
        rays = _finer(self.rays.movedim(-1, 0)).movedim(0, -1)
        return Target(rays, _finer(self.rise[None])[0], self.height, self.far)

    def depth_at(self, height: Float[Tensor, "*p h w"]) -> Float[Tensor, "*p h w"]:
        """Return the depth at which rays are at a height; those that never are end far away."""
        rise = torch.where(self.rise.abs() < 1e-6, torch.full_like(self.rise, -1e-6), self.rise)
        depth = (height - self.height) / rise
        return torch.where(depth > 0, depth, torch.full_like(depth, self.far)).clamp(_LEAST_DEPTH, self.far)

    def height_of(self, depth: Float[Tensor, "h w"]) -> Float[Tensor, "h w"]:
        """Return the height at a depth."""
        return self.height + depth * self.rise


@dataclass(frozen=True)
class Inputs:
    """The cameras of input views, seen from a target's centre: in_cam = turn (point - centre) + shift."""

    turn: Float[Tensor, "v 3 3"]
    shift: Float[Tensor, "v 3"]
    intrinsics: Float[Tensor, "v 4"]
    width_px: int
    height_px: int

    @classmethod
    def of(cls, scene: Scene, target: int, views: Int[np.ndarray, " v"], device: torch.device) -> Inputs:
        """Take views of a scene."""
        cam_from_world = invert(scene.world_from_cam[views][..., :3, :])
        turn, centre = cam_from_world[..., :3], scene.world_from_cam[target, :3, 3]
        shift = turn @ centre + cam_from_world[..., 3]
        tensors = (on_device(turn, device), on_device(shift, device), on_device(scene.intrinsics[views], device))
        return cls(*tensors, scene.width_px, scene.height_px)

    def project(
        self, target: Target, depth: Float[Tensor, "p h w"]
    ) -> tuple[Float[Tensor, "v p h w 2"], Bool[Tensor, "v p h w"]]:
        """Return the pixels of points at depths of the target's rays, and whether views see them if nothing hides them."""
        turned = torch.einsum("vij,hwj->ivhw", self.turn, target.rays)[:, :, None]
        x, y, z = turned * depth + self.shift.T[..., None, None, None]
        fx, fy, cx, cy = (one.view(-1, 1, 1, 1) for one in self.intrinsics.unbind(-1))
        ahead = z > 1e-6
        z = torch.where(ahead, z, torch.ones_like(z))
        x, y = x / z * fx + cx, y / z * fy + cy
        inside = (x >= 0) & (x <= self.width_px) & (y >= 0) & (y <= self.height_px)
        return torch.stack([x, y], dim=-1), inside & ahead

    def hidden(
        self,
        target: Target,
        depth: Float[Tensor, "h w"],
        scaffolds: Float[Tensor, "v 1 y x"],
        xy_px: Float[Tensor, "v 1 h w 2"],
    ) -> Bool[Tensor, "v h w"]:
        """Return where views do not see points, as something nearer lies in front of them in the scaffold at their poses."""
        turned = torch.einsum("vj,hwj->vhw", self.turn[:, 2], target.rays * depth[..., None])
        nearest = lookup(scaffolds, xy_px, 1, "nearest")[:, 0, 0]
        return (nearest > 0) & (turned + self.shift[:, 2, None, None] > _HIDDEN * nearest)

    def cosines(self, target: Target, depth: Float[Tensor, "h w"]) -> Float[Tensor, "v h w"]:
        """Return the cosine between the lines from the target and from each view to points."""
        turned = torch.einsum("vij,hwj->ivhw", self.turn, target.rays * depth[..., None])
        there = turned + self.shift.T[:, :, None, None]
        return (turned * there).sum(0) * torch.rsqrt((turned**2).sum(0) * (there**2).sum(0) + 1e-12)


def fine_colours(
    target: Target, inputs: Inputs, fine: Float[Tensor, "v 3 y2 x2"], heights: Float[Tensor, "h w"]
) -> Float[Tensor, "v 3 h w"]:
    """Return what fine images show at heights of a target's rays: the mean of each pixel's parts.

    A pixel is the light of its whole square; looked up at one place of an image of its own size it is what that image has
    made of four pixels, and softer than a photograph.
    """
    finer = target.finer()
    heights = F.interpolate(heights[None, None], size=finer.rise.shape, mode="bilinear", align_corners=False)[0]
    xy_px, _ = inputs.project(finer, finer.depth_at(heights))
    return F.avg_pool2d(lookup(fine, xy_px, 1 / FINER)[:, :, 0], FINER)


def lookup(
    maps: Float[Tensor, "v c y x"], xy_px: Float[Tensor, "v p h w 2"], stride: float, mode: str = "bilinear"
) -> Float[Tensor, "v c p h w"]:
    """Interpolate maps, of which a feature stands for the middle of a square of `stride` pixels; the border is repeated."""
    size = torch.tensor([maps.shape[3] * stride, maps.shape[2] * stride], device=maps.device)
    grid = (xy_px / size * 2 - 1).clamp(-3, 3)
    found = F.grid_sample(maps, grid.flatten(1, 2), mode, padding_mode="border", align_corners=False)
    return found.unflatten(2, xy_px.shape[1:3])


def on_device(array: np.ndarray, device: torch.device) -> Tensor:
    """Return an array as a tensor of single precision."""
    if array.dtype.itemsize > np.dtype(np.float32).itemsize:
        array = array.astype(np.float32)
    return torch.tensor(array, device=device).float()  # sent as it is stored: pictures are a quarter as large as bytes


def _finer(values: Float[Tensor, "c h w"]) -> Float[Tensor, "c h2 w2"]:
    """Return what is linear in a pixel's place at the middles of the pixel's parts."""
    for axis in (1, 2):
        count = values.shape[axis]
        step = values.narrow(axis, 1, 1) - values.narrow(axis, 0, 1)
        parts = (torch.arange(FINER, device=values.device) + 0.5) / FINER - 0.5
        shape = [1, -1, 1] if axis == 1 else [1, 1, -1]
        values = values.repeat_interleave(FINER, axis) + parts.repeat(count).view(shape) * step
    return values


def _pooled(values: Float[Tensor, "c h w"], stride: int) -> Float[Tensor, "c y x"]:
    return F.avg_pool2d(values[None], stride)[0]
