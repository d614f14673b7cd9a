"""Colours and densities along rays -> pixels (the quadrature of Max 1995 that NeRF uses)."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor


@dataclass(frozen=True)
class Pixels:
    """What rays show."""

    colour: Float[Tensor, "r 3"]
    depth: Float[Tensor, " r"]  # expected t
    weights: Float[Tensor, "r s"]  # share of the light that comes from each sample


def composite(
    colour: Float[Tensor, "r s 3"],
    density: Float[Tensor, "r s"],
    t: Float[Tensor, "r s"],
    lengths: Float[Tensor, "r s"],
    opaque_end: bool,
) -> Pixels:
    """Add up samples front to back; `lengths` are the samples' extents in the unit that density is per."""
    alpha = 1 - torch.exp(-density * lengths)
    if opaque_end:
        alpha = torch.cat([alpha[:, :-1], torch.ones_like(alpha[:, -1:])], dim=1)
    passed = torch.cumprod(1 - alpha + 1e-10, dim=1)
    passed = torch.cat([torch.ones_like(passed[:, :1]), passed[:, :-1]], dim=1)
    weights = alpha * passed
    return Pixels((weights[..., None] * colour).sum(dim=1), (weights * t).sum(dim=1), weights)
