"""Points in the world -> points, directions and pixels of the input views; and what maps hold at those pixels."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn import functional as F


@dataclass(frozen=True)
class Cameras:
    """The input views of several groups."""

    cam_from_world: Float[Tensor, "g v 3 4"]
    intrinsics: Float[Tensor, "g v 4"]
    width_px: int
    height_px: int

    def points_in_cam(self, points_in_world: Float[Tensor, "g p 3"]) -> Float[Tensor, "g v p 3"]:
        """Map points into each input view's frame."""
        rotation, shift = self.cam_from_world[..., :3], self.cam_from_world[..., 3]
        return torch.einsum("gvij,gpj->gvpi", rotation, points_in_world) + shift[:, :, None]

    def directions_in_cam(self, directions_in_world: Float[Tensor, "g p 3"]) -> Float[Tensor, "g v p 3"]:
        """Turn directions into each input view's frame."""
        return torch.einsum("gvij,gpj->gvpi", self.cam_from_world[..., :3], directions_in_world)

    def project(
        self, points_in_cam: Float[Tensor, "g v p 3"]
    ) -> tuple[Float[Tensor, "g v p 2"], Bool[Tensor, "g v p"]]:
        """Return pixels, and whether they are in front of the view and inside its image."""
        focal, principal = self.intrinsics[:, :, None, :2], self.intrinsics[:, :, None, 2:]
        depth = points_in_cam[..., 2:]
        ahead = depth > 1e-6
        xy_px = points_in_cam[..., :2] / torch.where(ahead, depth, torch.ones_like(depth)) * focal + principal
        x, y = xy_px.unbind(-1)
        inside = (x >= 0) & (x <= self.width_px) & (y >= 0) & (y <= self.height_px)
        return xy_px, ahead[..., 0] & inside


@dataclass(frozen=True)
class Grid:
    """Where a map's columns and rows lie in the image: j stands for `first_px + j * stride_px`, pixel centres at halves."""

    stride_px: int
    first_px: float


PIXELS = Grid(stride_px=1, first_px=0.5)  # of the image itself


@dataclass(frozen=True)
class Lookup:
    """Four neighbours and their bilinear weights for each point in each view's map; the border is repeated outside.

    Gathering from a table with a row per map pixel is several times faster on a CPU than `grid_sample`, and exact.
    """

    index: Tensor  # (g v p 4), rows of the table
    weight: Tensor  # (g v p 4)

    def __call__(self, maps: Float[Tensor, "g v h w c"]) -> Float[Tensor, "g v p c"]:
        """Interpolate maps at the points."""
        table = maps.reshape(-1, maps.shape[-1])
        found = F.embedding_bag(
            self.index.reshape(-1, 4), table, per_sample_weights=self.weight.reshape(-1, 4), mode="sum"
        )
        return found.reshape(*self.index.shape[:3], -1)


def lookup(xy_px: Float[Tensor, "g v p 2"], grid: Grid, width: int, height: int) -> Lookup:
    """Find the neighbours of image positions in maps of a given grid and size."""
    groups, views = xy_px.shape[:2]
    x, y = ((xy_px - grid.first_px) / grid.stride_px).unbind(-1)
    x, y = x.clamp(0, width - 1), y.clamp(0, height - 1)
    left, top = x.floor().clamp(max=max(width - 2, 0)), y.floor().clamp(max=max(height - 2, 0))
    right_part, bottom_part = x - left, y - top
    step_x, step_y = min(1, width - 1), min(1, height - 1)
    base = torch.arange(groups * views, device=xy_px.device).reshape(groups, views, 1) * (width * height)
    corner = base + top.long() * width + left.long()
    index = torch.stack([corner, corner + step_x, corner + step_y * width, corner + step_y * width + step_x], dim=-1)
    weight = torch.stack(
        [
            (1 - right_part) * (1 - bottom_part),
            right_part * (1 - bottom_part),
            (1 - right_part) * bottom_part,
            right_part * bottom_part,
        ],
        dim=-1,
    )
    return Lookup(index, weight)
