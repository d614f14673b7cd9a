"""Input photographs -> feature maps.

An encoder is a module with `channels` and `stride`; it maps images (b, 3, h, w) in [-1, 1] to maps (b, channels, h',
w') in which the feature at column j stands for the image position stride * (j + 1/2) px, and likewise for rows. A
second encoder is a second class and an entry in ENCODERS.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F


class ResidualBlock(nn.Module):
    """Two 3x3 convolutions around a skip; the second starts at zero, so that the block starts as the identity."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(channels, channels, 3, padding=1)
        self.second = nn.Conv2d(channels, channels, 3, padding=1)
        nn.init.zeros_(self.second.weight)

    def forward(self, maps: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c h w"]:
        """Add what the convolutions find."""
        return maps + self.second(F.relu(self.first(F.relu(maps))))


class SmallEncoder(nn.Module):
    """A residual encoder with maps at a half and a quarter of the image, both handed on at a half.

    Kernels of 4 with stride 2 keep the stated alignment; without normalisation it is the same in training and in use.
    """

    stride = 2

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.channels = 3 * channels
        self.at_half = nn.Sequential(nn.Conv2d(3, channels, 4, stride=2, padding=1), ResidualBlock(channels))
        self.at_quarter = nn.Sequential(
            nn.Conv2d(channels, 2 * channels, 4, stride=2, padding=1), *(ResidualBlock(2 * channels) for _ in range(2))
        )

    def forward(self, images: Float[Tensor, "b 3 H W"]) -> Float[Tensor, "b c h w"]:
        """Encode images."""
        half = self.at_half(images)
        quarter = F.interpolate(self.at_quarter(half), size=half.shape[-2:], mode="bilinear", align_corners=False)
        return torch.cat([half, quarter], dim=1)


ENCODERS = {"small": SmallEncoder}
