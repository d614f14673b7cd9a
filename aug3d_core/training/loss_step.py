"""A training step as one module, so that DistributedDataParallel can wrap it: groups go in, loss and measures come out."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn

from aug3d_core.dataset.batches import Group
from aug3d_core.dataset.scene import Scene
from aug3d_core.heads.head import Head


class Step(nn.Module):
    """The head and the scenes that it is trained on."""

    def __init__(self, head: Head, scenes: Sequence[Scene]) -> None:
        super().__init__()
        self.head, self.scenes = head, tuple(scenes)

    def forward(
        self, groups: Sequence[Group], noise: torch.Generator | None
    ) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
        """Return the loss, and the measures by name, the loss among them, without their graph."""
        loss, measured = self.head.loss(self.scenes, groups, noise)
        return loss, {name: value.detach() for name, value in {"loss": loss, **measured}.items()}
