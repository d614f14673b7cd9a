"""A point and what the input views show there -> colour and density (the field of pixelNeRF).

Per input view: the point in that view's frame (encoded), the viewing direction in that frame, and the image features
where the point projects; residual blocks; the average over views; more blocks. Each difference from the paper is a field of
the configuration: `see_pixels`, `even_exposure`, `mask_unseen`, `blend_inputs`, `encode_height`, and `density`.

Feature layers and bilinear sampling are both linear, so the maps are projected once per image (`project`) and the
projections are sampled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import cast

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn
from torch.nn import functional as F

from aug3d_core.heads.pixelnerf.config import PixelNerfConfig
from aug3d_core.heads.pixelnerf.cpu_mlp import ResidualStack

HEIGHT_OCTAVES = 5  # of the encoding of the height in the slab
VOTERS = 16  # hidden units that weigh an input view's colour
NEARER = 20.0  # what an input view loses at first per unit of cosine: views along the ray are the best witnesses
SOFT = 0.02  # input colours are kept this far from 0 and 1 before the logit


@dataclass(frozen=True)
class SeenPixels:
    """The input images themselves at points; v views, p points."""

    colour: Float[Tensor, "g v p 3"]
    shown: Float[Tensor, "g v p 3"]  # as the network sees it: at the brightness and contrast that all groups have
    cosine: Float[Tensor, "g v p"]  # between the ray and the view's own ray to the point
    fallback: Float[Tensor, "g 3"]  # mean colour of the inputs


@dataclass(frozen=True)
class Seen:
    """What the input views know of points."""

    position: Float[Tensor, "g v p 3"]  # in the view's frame, in units of the scene's scale
    direction: Float[Tensor, "g v p 3"]  # of the ray, in the view's frame, unit length
    height: Float[Tensor, "g p"]  # in the slab: 0 at its bottom, 1 at its top
    features: Float[Tensor, "g v p bh"]  # of each block, side by side
    visible: Bool[Tensor, "g v p"] | None  # None: every view counts
    pixels: SeenPixels | None  # None: the configuration does not look at them


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

    def __init__(self, config: PixelNerfConfig, channels: int) -> None:
        super().__init__()
        self.config = config
        width = config.hidden
        self.features = nn.Linear(channels, width * config.blocks_per_view)
        self.enter = nn.Linear(3 * (1 + 2 * config.frequencies) + 3 + (4 if config.see_pixels else 0), width)
        self.per_view = nn.ModuleList(Block(width) for _ in range(config.blocks_per_view))
        self.level = nn.Linear(1 + 2 * HEIGHT_OCTAVES, width) if config.encode_height else None
        self.pooled = nn.ModuleList(Block(width) for _ in range(config.blocks_pooled))
        self.leave = nn.Linear(width, 4)
        if config.blend_inputs:
            self.vote_each, self.vote_all = nn.Linear(width, VOTERS), nn.Linear(width, VOTERS, bias=False)
            self.vote = nn.Linear(VOTERS, 1, bias=False)
        self._start()

    def _start(self) -> None:
        """Start thin, so that light reaches the end of the ray, and with the blend alone; with ReLU density, as the paper.

        A density of ReLU that starts at zero would have no gradient, ever.
        """
        if self.config.density == "relu":
            for layer in (self.features, self.enter, self.leave):
                nn.init.kaiming_normal_(layer.weight)
                nn.init.zeros_(layer.bias)
        else:
            nn.init.zeros_(self.leave.weight)
            nn.init.zeros_(self.leave.bias)
        if self.config.blend_inputs:
            nn.init.zeros_(self.vote.weight)

    @property
    def _before_mean(self) -> list[Block]:
        return cast("list[Block]", list(self.per_view))

    def project(self, maps: Float[Tensor, "n h w c"]) -> Float[Tensor, "n h w bh"]:
        """Apply every block's feature layer to whole maps, and add the biases that what is looked up will meet anyway.

        Weights of a bilinear lookup sum to one, so a constant passes through it.
        """
        met: list[Tensor] = [self.enter.bias, *(block.second.bias for block in self._before_mean[:-1])]
        return F.linear(maps, self.features.weight, self.features.bias + torch.cat(met))

    def forward(self, seen: Seen) -> tuple[Float[Tensor, "g p 3"], Float[Tensor, "g p"]]:
        """Return colour in [0, 1] and density per slab thickness."""
        each = self._each_view(seen)
        x = each.mean(dim=1) if seen.visible is None else _mean_of(each, seen.visible)
        if self.level is not None:
            x = x + self.level(torch.cat(encode(seen.height[..., None], HEIGHT_OCTAVES), dim=-1))
        for block in self.pooled:
            x = block(x)
        x = F.relu(x)
        out = self.leave(x)
        density = F.relu(out[..., 3]) if self.config.density == "relu" else F.softplus(10 * out[..., 3] - 1)
        return torch.sigmoid(self._logits(out[..., :3], x, each, seen)), density

    def _each_view(self, seen: Seen) -> Float[Tensor, "g v p h"]:
        """Return what each view makes of each point: the blocks before the average, the biases in the features."""
        known = [*encode(seen.position, self.config.frequencies), seen.direction]
        if self.config.see_pixels and seen.pixels is not None:
            known += [seen.pixels.shown, seen.pixels.cosine[..., None]]
        shape, blocks = seen.features.shape[:-1], self._before_mean
        seen_by_each, features = torch.cat(known, dim=-1).flatten(0, -2), seen.features.flatten(0, -2)
        if features.is_cuda:
            x = self._in_layers(seen_by_each, features)
        else:
            x = ResidualStack.apply(
                seen_by_each,
                features,
                self.enter.weight,
                torch.stack([block.first.weight for block in blocks]),
                torch.stack([block.first.bias for block in blocks]),
                torch.stack([block.second.weight for block in blocks]),
                torch.is_grad_enabled(),
            )
        return x.unflatten(0, shape) + blocks[-1].second.bias

    def _in_layers(self, known: Float[Tensor, "n d"], features: Float[Tensor, "n bh"]) -> Float[Tensor, "n h"]:
        """Return what the stack does, in layers that mixed precision knows."""
        x = F.linear(known, self.enter.weight)
        for block, some in zip(self._before_mean, features.split(self.config.hidden, dim=1), strict=True):
            x = x + some
            x = x + F.linear(F.relu(block.first(F.relu(x))), block.second.weight)
        return x

    def _logits(
        self, added: Float[Tensor, "g p 3"], x: Float[Tensor, "g p h"], each: Tensor, seen: Seen
    ) -> Float[Tensor, "g p 3"]:
        """Return the colour's logits: what the network adds to the blend of the input pixels, or that alone."""
        pixels = seen.pixels
        if not self.config.blend_inputs or pixels is None:
            return added
        voters = F.relu(self.vote_each(each) + self.vote_all(x)[:, None])
        score = self.vote(voters)[..., 0] + NEARER * (pixels.cosine - 1)
        if seen.visible is None:
            blend = (torch.softmax(score, dim=1)[..., None] * pixels.colour).sum(dim=1)
        else:
            unseen = ~seen.visible.any(dim=1)
            score = score.masked_fill(~seen.visible, -math.inf).masked_fill(unseen[:, None], 0.0)
            blend = (torch.softmax(score, dim=1)[..., None] * pixels.colour).sum(dim=1)
            blend = torch.where(unseen[..., None], pixels.fallback[:, None], blend)
        return torch.logit(blend.clamp(SOFT, 1 - SOFT)) + added


def _mean_of(each: Float[Tensor, "g v p h"], visible: Bool[Tensor, "g v p"]) -> Float[Tensor, "g p h"]:
    """Average over the views that see a point; nothing where none does."""
    weight = visible.to(each.dtype)
    weight = weight / weight.sum(dim=1, keepdim=True).clamp(min=1)
    return (weight[..., None] * each).sum(dim=1)


def encode(x: Float[Tensor, "*n d"], frequencies: int) -> tuple[Tensor, Tensor, Tensor]:
    """Encode positions: themselves, then sines, then cosines at 1.5 times powers of two (pixelNeRF's factor)."""
    octaves = 1.5 * 2.0 ** torch.arange(frequencies, dtype=x.dtype, device=x.device)
    scaled = (x[..., None, :] * octaves[:, None]).flatten(-2)
    return x, scaled.sin(), scaled.cos()
