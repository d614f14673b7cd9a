"""Where along a ray to look. Samples are t values between the ray's near and far; `noise` is uniform in [0, 1).

Training passes random noise; a whole view is rendered with noise 1/2 everywhere, so that it is the same every time.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

_DEVIATION = 0.01  # of samples around the expected depth: a share of the ray's length


def stratified(
    near: Float[Tensor, " r"], far: Float[Tensor, " r"], noise: Float[Tensor, "r s"]
) -> Float[Tensor, "r s"]:
    """Put one sample into each of s equal parts of the ray."""
    count = noise.shape[1]
    share = (torch.arange(count, dtype=near.dtype, device=near.device) + noise) / count
    return near[:, None] + (far - near)[:, None] * share


def edges(t: Float[Tensor, "r s"], near: Float[Tensor, " r"], far: Float[Tensor, " r"]) -> Float[Tensor, "r s+1"]:
    """Return the borders between samples: half way, and near and far at the ends."""
    middle = (t[:, 1:] + t[:, :-1]) / 2
    return torch.cat([near[:, None], middle, far[:, None]], dim=1)


def by_importance(
    borders: Float[Tensor, "r s1"], weights: Float[Tensor, "r s"], noise: Float[Tensor, "r f"]
) -> Float[Tensor, "r f"]:
    """Draw samples with density proportional to the weights within their borders (inverse of the distribution)."""
    count = noise.shape[1]
    share = (torch.arange(count, dtype=noise.dtype, device=noise.device) + noise) / count
    density = weights + 1e-4
    heights = torch.cumsum(density / density.sum(dim=1, keepdim=True), dim=1)
    heights = torch.cat([torch.zeros_like(heights[:, :1]), heights], dim=1)
    part = torch.searchsorted(heights.contiguous(), share.contiguous(), right=True).clamp(1, weights.shape[1]) - 1
    low, high = heights.gather(1, part), heights.gather(1, part + 1)
    start, end = borders.gather(1, part), borders.gather(1, part + 1)
    return start + (end - start) * ((share - low) / (high - low).clamp(min=1e-8)).clamp(0, 1)


def around_depth(
    depth: Float[Tensor, " r"],
    near: Float[Tensor, " r"],
    far: Float[Tensor, " r"],
    noise: Float[Tensor, "r d"],
) -> Float[Tensor, "r d"]:
    """Draw samples normally around the expected depth."""
    count = noise.shape[1]
    share = (torch.arange(count, dtype=noise.dtype, device=noise.device) + noise) / count
    normal = torch.special.ndtri(share.clamp(1e-4, 1 - 1e-4))
    t = depth[:, None] + normal * _DEVIATION * (far - near)[:, None]
    return torch.maximum(torch.minimum(t, far[:, None]), near[:, None])
