"""Input photographs -> feature maps.

An encoder is a module with `channels` and `grid`; it maps images (b, 3, h, w) in [-1, 1] to maps (b, channels, h', w'),
and the grid says which image position the feature at each column and row stands for. A further encoder is a further class
and an entry in ENCODERS.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from itertools import count
from typing import Any
from weakref import ref

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

from aug3d_core.dataset.scene import Scene
from aug3d_core.heads.pixelnerf.cameras import Grid
from aug3d_core.heads.pixelnerf.config import PixelNerfConfig
from aug3d_core.heads.pixelnerf.resnet import ResNet34


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

    grid = Grid(stride_px=2, first_px=1.0)

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


class PaperEncoder(nn.Module):
    """The paper's encoder: the first four maps of ResNet-34 (512 channels), all at the size of the first.

    Its first convolution centres column j on pixel 2j. Frozen, it stays in evaluation mode and records no graph.
    """

    grid = Grid(stride_px=2, first_px=0.5)
    channels = 64 + 64 + 128 + 256

    def __init__(self, frozen: bool) -> None:
        super().__init__()
        self.frozen = frozen
        self.trunk = ResNet34()
        if frozen:
            self.requires_grad_(False)
            self.eval()

    def train(self, mode: bool = True) -> PaperEncoder:
        """Switch between training and use; batch normalisation of a frozen encoder never goes back to training."""
        return super().train(mode and not self.frozen)

    def forward(self, images: Float[Tensor, "b 3 H W"]) -> Float[Tensor, "b c h w"]:
        """Encode images."""
        first, *others = self.trunk(images)
        size = first.shape[-2:]
        return torch.cat(
            [first, *(F.interpolate(maps, size=size, mode="bilinear", align_corners=True) for maps in others)], dim=1
        )


ENCODERS: dict[str, Callable[[PixelNerfConfig], SmallEncoder | PaperEncoder]] = {
    "small": lambda config: SmallEncoder(config.encoder_channels),
    "resnet34": lambda config: PaperEncoder(config.encoder_frozen),
}


class Encoded:
    """Maps that a frozen encoder made of views, up to a limit of memory; the oldest go first.

    Scenes that share their pictures share the maps; pictures that are gone have none.
    """

    def __init__(self, limit_bytes: int = 2**30) -> None:
        self._limit_bytes = limit_bytes
        self._pictures: dict[int, ref[Any]] = {}  # by number
        self._numbers = count()
        self._kept: OrderedDict[tuple[int, int], Tensor] = OrderedDict()  # by number of the pictures and view

    def forget(self) -> None:
        """Drop all maps: the encoder has other weights now."""
        self._kept.clear()

    def maps(
        self, scene: Scene, views: Int[np.ndarray, " n"], encode: Callable[[Int[np.ndarray, " m"]], Tensor]
    ) -> Float[Tensor, "n h w c"]:
        """Return maps of views; those at the places `encode` is given are encoded now."""
        own = self._number(scene.images)
        wanted = [(own, int(view)) for view in views]
        new = np.array([place for place, view in enumerate(wanted) if view not in self._kept], int)
        if len(new):
            self._kept.update(zip((wanted[place] for place in new), encode(new), strict=True))
        maps = torch.stack([self._kept[view] for view in wanted])
        while sum(one.nbytes for one in self._kept.values()) > self._limit_bytes and len(self._kept) > 1:
            self._kept.popitem(last=False)
        return maps

    def _number(self, pictures: Any) -> int:
        """Return the number of a scene's pictures; drop those that are gone, with their maps."""
        self._pictures = {number: one for number, one in self._pictures.items() if one() is not None}
        for view in [view for view in self._kept if view[0] not in self._pictures]:
            del self._kept[view]
        known = next((number for number, one in self._pictures.items() if one() is pictures), None)
        if known is None:
            known = next(self._numbers)
            self._pictures[known] = ref(pictures)
        return known
