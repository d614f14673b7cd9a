"""PixelNeRF as a head: what training and judging see of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from aug3d_core.dataset.batches import Group, pixel_colours
from aug3d_core.dataset.rays import pixel_rays
from aug3d_core.dataset.scene import Scene
from aug3d_core.heads.config import Symptom
from aug3d_core.heads.head import Head, Start, View, colour_measures, weighted_mean
from aug3d_core.heads.pixelnerf.compositing import Pixels
from aug3d_core.heads.pixelnerf.config import PixelNerfConfig
from aug3d_core.heads.pixelnerf.encoder import PaperEncoder
from aug3d_core.heads.pixelnerf.encoder_weights import start_trunk
from aug3d_core.heads.pixelnerf.model import PixelNeRF, TensorRays
from aug3d_core.heads.pixelnerf.prediction import predict
from aug3d_core.run.stage import Decision

Measured = dict[str, Float[Tensor, ""]]


class PixelNerfHead(PixelNeRF, Head):
    """The model with its loss: the squared errors of the coarse and of the fine colours."""

    config: PixelNerfConfig
    # The slab reaches below the ground and above the roofs, so light is never rightly stopped only at one of its ends
    symptoms: ClassVar[Mapping[str, Symptom]] = {
        "no light is stopped on any ray": lambda step: step["light"] < 1e-4,  # healthy: never below 0.25
        "all light is stopped where rays begin": lambda step: step["front"] > 1 - 1e-4,  # healthy: never above 0.11
    }

    def start(self) -> Start:
        """Load the weights of the paper's encoder that the settings name."""
        asked, found = self.config.encoder_weights, "random"
        if isinstance(self.encoder, PaperEncoder):
            found = start_trunk(self.encoder.trunk, asked)
        short = found.partition(",")[0]
        as_asked = found in ("random", "ImageNet", asked)
        return Start(
            metrics={"encoder_from": short},
            notes=() if as_asked else (f"the encoder's first weights are {found}",),
            decisions=(
                Decision(
                    field="training.encoder_from", value=short, measured=f"{asked} asked for", rule="what is available"
                ),
            ),
        )

    def loss(
        self, scenes: Sequence[Scene], groups: Sequence[Group], noise: torch.Generator | None
    ) -> tuple[Float[Tensor, ""], Measured]:
        """Compare the pixels that were drawn from each group's targets. light, front: shares of the light that the fine
        field stops before the end of a ray, and at its first sample.
        """
        parts = []
        for number in sorted({group.scene for group in groups}):
            own = [group for group in groups if group.scene == number]
            parts.append((len(own) / len(groups), self._loss_in(scenes[number], own, noise)))
        if len(parts) == 1:
            return parts[0][1]
        loss = torch.stack([share * loss for share, (loss, _) in parts]).sum()
        names = parts[0][1][1]
        return loss, {name: torch.stack([share * told[name] for share, (_, told) in parts]).sum() for name in names}

    def predict(self, scene: Scene, target: int, inputs: Int[np.ndarray, " v"]) -> View:
        """Predict a view along the rays of all its pixels; the coarse colours are a part of it."""
        return predict(self, scene, target, inputs)

    def _loss_in(
        self, scene: Scene, groups: Sequence[Group], noise: torch.Generator | None
    ) -> tuple[Float[Tensor, ""], Measured]:
        drawn = np.concatenate([group.pixels for group in groups if group.pixels is not None])
        views, xy = drawn[:, 0], drawn[:, 1:]
        rays = TensorRays.of(pixel_rays(scene, views, xy + 0.5, self.config.slab_bounds), len(groups))
        inputs = self.encode(scene, np.stack([group.inputs for group in groups]))
        coarse, fine = self(inputs, rays, noise, mixed=self.device.type == "cuda")
        colours, shown = pixel_colours(scene, drawn)
        truth, weight = self._grouped(colours, len(groups)), self._grouped(shown, len(groups))[..., None]
        weight = weight / weight.sum(dim=1, keepdim=True).clamp(min=1)
        measured = colour_measures(fine.colour.reshape_as(truth), truth, weight)
        loss = measured["error"] + weighted_mean((coarse.colour.reshape_as(truth) - truth) ** 2, weight)
        return loss, measured | self._light(fine)

    def _light(self, pixels: Pixels) -> Measured:
        stopped = pixels.weights[:, :-1] if self.config.opaque_end else pixels.weights
        return {"light": stopped.sum(dim=1).mean(), "front": pixels.weights[:, 0].mean()}

    def _grouped(self, array: np.ndarray, groups: int) -> Tensor:
        """Return values listed group after group as (g, r, ...), where the model is."""
        values = torch.from_numpy(array.astype(np.float32)).to(self.device)
        return values.reshape(groups, -1, *array.shape[1:])


HEAD = PixelNerfHead
