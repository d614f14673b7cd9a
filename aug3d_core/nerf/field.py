"""A point and what the input views show there -> colour and density (the field of pixelNeRF).

Per input view: the point in that view's frame (encoded), the viewing direction in that frame, and the image features
where the point projects; residual blocks; the average over views; more blocks. Differences from the paper: the colour
where the point projects goes in beside the features; `blend_inputs` starts from those colours; `encode_height` tells
how high in the slab the point lies; and points outside or behind a view take nothing from it.

Feature layers and bilinear sampling are both linear, so the maps are projected once per image (`project`) and the
projections are sampled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn
from torch.nn import functional as F

from aug3d_core.nerf.config import TrainingConfig

HEIGHT_OCTAVES = 5  # of the encoding of the height in the slab
VOTERS = 16  # hidden units that weigh an input view's colour
NEARER = 20.0  # what an input view loses at first per unit of cosine: views along the ray are the best witnesses
SOFT = 0.02  # input colours are kept this far from 0 and 1 before the logit


@dataclass(frozen=True)
class Seen:
    """What the input views know of points; v views, p points."""

    position: Float[Tensor, "g v p 3"]  # in the view's frame, in units of the scene's scale
    direction: Float[Tensor, "g v p 3"]  # of the ray, in the view's frame, unit length
    cosine: Float[Tensor, "g v p"]  # between the ray and the view's own ray to the point
    height: Float[Tensor, "g p"]  # in the slab: 0 at its bottom, 1 at its top
    features: Float[Tensor, "g v p b*h"]  # of each block, side by side
    colour: Float[Tensor, "g v p 3"]
    visible: Bool[Tensor, "g v p"]
    fallback: Float[Tensor, "g 3"]  # mean colour of the inputs


class Block(nn.Module):
    """A residual block of the paper: fc, ReLU, twice; the second layer starts at zero."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first, self.second = nn.Linear(width, width), nn.Linear(width, width)
        nn.init.kaiming_normal_(self.first.weight)
        nn.init.zeros_(self.first.bias)
        nn.init.zeros_(self.second.weight)
        nn.init.zeros_(self.second.bias)

    def forward(self, x: Float[Tensor, "*n w"]) -> Float[Tensor, "*n w"]:
        """Add what the layers find."""
        return x + self.second(F.relu(self.first(F.relu(x))))


class Field(nn.Module):
    """The network; there is one for the coarse and one for the fine pass."""

    def __init__(self, config: TrainingConfig, channels: int) -> None:
        super().__init__()
        self.config = config
        width = config.hidden
        self.features = nn.Conv2d(channels, width * config.blocks_per_view, 1)
        self.enter = nn.Linear(3 * (1 + 2 * config.frequencies) + 3 + 3 + 1, width)
        self.per_view = nn.ModuleList(Block(width) for _ in range(config.blocks_per_view))
        self.level = nn.Linear(1 + 2 * HEIGHT_OCTAVES, width) if config.encode_height else None
        self.pooled = nn.ModuleList(Block(width) for _ in range(config.blocks_pooled))
        self.leave = nn.Linear(width, 4)
        if config.blend_inputs:
            self.vote_each, self.vote_all = nn.Linear(width, VOTERS), nn.Linear(width, VOTERS, bias=False)
            self.vote = nn.Linear(VOTERS, 1, bias=False)
        self._start()

    def _start(self) -> None:
        """Start thin, so that light reaches the end of the ray, and with the blend alone."""
        nn.init.zeros_(self.leave.weight)
        nn.init.zeros_(self.leave.bias)
        if self.config.blend_inputs:
            nn.init.zeros_(self.vote.weight)

    def project(self, maps: Float[Tensor, "n c h w"]) -> Float[Tensor, "n b*h h w"]:
        """Apply every block's feature layer to whole maps."""
        return self.features(maps)

    def forward(self, seen: Seen) -> tuple[Float[Tensor, "g p 3"], Float[Tensor, "g p"]]:
        """Return colour in [0, 1] and density per slab thickness."""
        each = self._each_view(seen)
        weight = seen.visible.to(each.dtype)
        weight = weight / weight.sum(dim=1, keepdim=True).clamp(min=1)
        x = (weight[..., None] * each).sum(dim=1)
        if self.level is not None:
            x = x + self.level(encode(seen.height[..., None], HEIGHT_OCTAVES))
        for block in self.pooled:
            x = block(x)
        x = F.relu(x)
        out = self.leave(x)
        return self._colour(out[..., :3], x, each, seen), F.softplus(10 * out[..., 3] - 1)

    def _each_view(self, seen: Seen) -> Float[Tensor, "g v p h"]:
        where = encode(seen.position, self.config.frequencies)
        known = torch.cat([where, seen.direction, seen.colour, seen.cosine[..., None]], dim=-1)
        x = self.enter(known)
        for block, features in zip(self.per_view, seen.features.split(self.config.hidden, dim=-1), strict=True):
            x = block(x + features)
        return x

    def _colour(
        self, residual: Float[Tensor, "g p 3"], x: Float[Tensor, "g p h"], each: Tensor, seen: Seen
    ) -> Float[Tensor, "g p 3"]:
        if not self.config.blend_inputs:
            return torch.sigmoid(residual)
        voters = F.relu(self.vote_each(each) + self.vote_all(x)[:, None])
        score = self.vote(voters)[..., 0] + NEARER * (seen.cosine - 1)
        unseen = ~seen.visible.any(dim=1)
        share = torch.softmax(score.masked_fill(~seen.visible, -math.inf).masked_fill(unseen[:, None], 0.0), dim=1)
        blend = (share[..., None] * seen.colour).sum(dim=1)
        blend = torch.where(unseen[..., None], seen.fallback[:, None], blend)
        return torch.sigmoid(torch.logit(blend.clamp(SOFT, 1 - SOFT)) + residual)


def encode(x: Float[Tensor, "*n d"], frequencies: int) -> Float[Tensor, "*n e"]:
    """Encode positions: themselves, and sines and cosines at 1.5 times powers of two (pixelNeRF's factor)."""
    scaled = [x * (1.5 * 2.0**octave) for octave in range(frequencies)]
    return torch.cat([x, *(wave(s) for s in scaled for wave in (torch.sin, torch.cos))], dim=-1)
