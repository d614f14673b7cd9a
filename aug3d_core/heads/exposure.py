"""One brightness and contrast for every group, so that a model is not lost where photographs are brighter than in training.

A kite or drone whose camera exposes by itself photographs its test block up to several times as bright as what training
saw. What the network learns is then right up to that factor, if it never sees the factor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

_MIDDLE, _SPREAD = 0.5, 0.25  # what every group's mean and standard deviation become
_DARKEST, _BRIGHTEST = 0.03, 0.97  # colours beyond say little of an exposure
_MOST_GAIN, _RIDGE, _FEWEST_POINTS = 2.0, 1e-3, 64
_LEAST_SPREAD = 0.02  # of images in [0, 1]: noise is not blown up to a picture


@dataclass(frozen=True)
class Exposure:
    """Mean and standard deviation of all colours of a group's input views, images in [0, 1]."""

    mean: Float[Tensor, " g"]
    spread: Float[Tensor, " g"]

    @classmethod
    def of(cls, rgb: Float[Tensor, "g v h w 3"], alpha: Float[Tensor, "g v h w 1"]) -> Exposure:
        """Measure groups, over the pixels that show something."""
        over = (1, 2, 3, 4)
        count = 3 * alpha.sum(dim=over).clamp(min=1)
        mean = (rgb * alpha).sum(dim=over) / count
        off = rgb - mean[:, None, None, None, None]
        spread = torch.sqrt((off**2 * alpha).sum(dim=over) / count)
        return cls(mean, spread.clamp(min=_LEAST_SPREAD))

    def even(self, rgb: Float[Tensor, "g *n 3"]) -> Float[Tensor, "g *n 3"]:
        """Return colours as the network sees them."""
        mean, spread = self._like(rgb)
        return (rgb - mean) / spread * _SPREAD + _MIDDLE

    def restore(self, shown: Float[Tensor, "g *n 3"]) -> Float[Tensor, "g *n 3"]:
        """Return the colours that `even` shows as these, in [0, 1]."""
        mean, spread = self._like(shown)
        return ((shown - _MIDDLE) / _SPREAD * spread + mean).clamp(0, 1)

    def _like(self, values: Tensor) -> tuple[Tensor, Tensor]:
        shape = (-1, *[1] * (values.dim() - 1))
        return self.mean.view(shape), self.spread.view(shape)


def gains(colours: Float[Tensor, "v 3 h w"], seen: Float[Tensor, "v 1 h w"]) -> Float[Tensor, "v 3"]:
    """Return factors that make views of the same points alike, in each channel; their logarithms have zero mean.

    For each two views that both see at least _FEWEST_POINTS points the median of their colours' ratio counts, as often as there
    are points. A view that shares none keeps its colours. A factor is at most _MOST_GAIN, or one by it.
    """
    views, device = len(colours), colours.device
    colours, seen = colours.cpu(), seen.cpu()  # small, and asked for a number at each pair: a GPU would be waited for
    usable = (
        (seen > 0) & (colours > _DARKEST).all(dim=1, keepdim=True) & (colours < _BRIGHTEST).all(dim=1, keepdim=True)
    )
    logs = colours.clamp(min=_DARKEST).log().flatten(2)
    equations = torch.zeros(views, views)
    wanted = torch.zeros(views, 3)
    for one in range(views):
        for other in range(one + 1, views):
            both = (usable[one] & usable[other]).flatten()
            count = int(both.sum())
            if count < _FEWEST_POINTS:
                continue
            apart = (logs[one][:, both] - logs[other][:, both]).median(dim=1).values
            equations[[one, other], [one, other]] += count
            equations[[one, other], [other, one]] -= count
            wanted[one] -= count * apart
            wanted[other] += count * apart
    ridge = _RIDGE * equations.diagonal().mean().clamp(min=1.0)
    found = torch.linalg.solve(equations + ridge * torch.eye(views), wanted)
    limit = math.log(_MOST_GAIN)
    return found.clamp(-limit, limit).exp().to(device)
