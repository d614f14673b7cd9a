"""A training step as one module: a batch goes in, the loss and what the watch wants to know come out.

It is one module so that DistributedDataParallel can wrap it. Everything is averaged within a group first and over groups
then: as many processes with a part of the groups each come to the same loss and gradients as one process with all.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from aug3d_core.dataset.batches import Batch
from aug3d_core.dataset.scene import Scene
from aug3d_core.heads.pixelnerf.compositing import Pixels
from aug3d_core.heads.pixelnerf.field import Field
from aug3d_core.heads.pixelnerf.model import PixelNeRF, TensorRays


class Step(nn.Module):
    """The model and the scene that it is trained on."""

    def __init__(self, model: PixelNeRF, scene: Scene) -> None:
        super().__init__()
        self.model, self.scene = model, scene
        if model.device.type == "cuda":
            for field in (model.coarse, model.fine):
                _mix_precision(field)

    def forward(self, batch: Batch, noise: torch.Generator | None) -> tuple[Float[Tensor, ""], Float[Tensor, " m"]]:
        """Return the loss, and all of Measures but the gradient, in that order."""
        groups = len(batch.inputs)
        inputs = self.model.encode(self.scene, batch.inputs)
        coarse, fine = self.model(inputs, TensorRays.of(batch.rays, groups), noise)
        truth = self._grouped(batch.colour, groups)
        weight = self._grouped(batch.weight, groups)[..., None]
        weight = weight / weight.sum(dim=1, keepdim=True).clamp(min=1)
        error = _mean((fine.colour.reshape_as(truth) - truth) ** 2, weight)
        loss = error + _mean((coarse.colour.reshape_as(truth) - truth) ** 2, weight)
        measured = [loss, error, *self._light(fine), *_spread_and_mean(fine.colour.reshape_as(truth), truth, weight)]
        return loss, torch.stack([value.detach() for value in measured])

    def _light(self, pixels: Pixels) -> tuple[Tensor, Tensor]:
        """Return the share of light that is stopped before the end of the ray, and that at its first sample."""
        weights = pixels.weights
        stopped = weights[:, :-1] if self.model.config.opaque_end else weights
        return stopped.sum(dim=1).mean(), weights[:, 0].mean()

    def _grouped(self, array: np.ndarray, groups: int) -> Tensor:
        """Return values listed group after group as (g, r, ...), where the model is."""
        values = torch.from_numpy(array.astype(np.float32)).to(self.model.device)
        return values.reshape(groups, -1, *array.shape[1:])


def _mean(values: Float[Tensor, "g r 3"], weight: Float[Tensor, "g r 1"]) -> Float[Tensor, ""]:
    """Average over channels, over the rays of each group that have a truth, and over groups."""
    return (values * weight).sum(dim=1).mean()


def _spread_and_mean(
    colour: Float[Tensor, "g r 3"], truth: Float[Tensor, "g r 3"], weight: Float[Tensor, "g r 1"]
) -> list[Float[Tensor, ""]]:
    """Return the variance over rays of colours and truth, then their means."""
    spreads = [_mean((x - (x * weight).sum(dim=1, keepdim=True)) ** 2, weight) for x in (colour, truth)]
    return [*spreads, _mean(colour, weight), _mean(truth, weight)]


def _mix_precision(field: Field) -> None:
    """Let a field compute in bfloat16; where points lie stays in float32, for it has to be known to a pixel's part."""
    forward: Callable[..., tuple[Tensor, Tensor]] = torch.autocast(field.leave.weight.device.type, torch.bfloat16)(
        field.forward
    )
    field.forward = lambda seen: tuple(part.float() for part in forward(seen))
