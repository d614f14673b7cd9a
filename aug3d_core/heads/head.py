"""The protocol of a head: all that training, judging and novel views know of a model."""

from __future__ import annotations

import importlib
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import torch
from jaxtyping import Bool, Float, Int, UInt8
from pydantic import Field
from torch import Tensor, nn

from aug3d_core.dataset.batches import Group
from aug3d_core.dataset.scene import Scene
from aug3d_core.heads.config import HeadConfig, Symptom
from aug3d_core.run.stage import Decision, Frozen


@dataclass(frozen=True)
class View:
    """A predicted view. What a head does not predict is None.

    depth: along the camera's z, world units. confidence: in the depth, 0 to 1. seen: some input shows it. started_from: what
    the depth was looked for about. parts: further pictures that the head made on the way, by name; they are scored and shown
    beside it.
    """

    colour: UInt8[np.ndarray, "h w 3"]
    depth: Float[np.ndarray, "h w"] | None = None
    confidence: Float[np.ndarray, "h w"] | None = None
    seen: Bool[np.ndarray, "h w"] | None = None
    started_from: str | None = None
    parts: Mapping[str, UInt8[np.ndarray, "h w 3"]] = field(default_factory=dict)


class Start(Frozen):
    """What a head starts from besides random weights: figures, notes and decisions for the stage's report."""

    metrics: dict[str, str] = Field(default={})
    notes: tuple[str, ...] = ()
    decisions: tuple[Decision, ...] = ()


class Head(nn.Module, ABC):
    """A view-synthesis model: posed views of a place -> a view from another pose.

    symptoms: signs that training cannot recover, each a sentence and a test of one step's measures; signs in colours alone are
    known to training.
    """

    symptoms: ClassVar[Mapping[str, Symptom]] = {}
    config: HeadConfig

    @property
    def device(self) -> torch.device:
        """Where the parameters are."""
        return next(self.parameters()).device

    def start(self) -> Start:
        """Load first weights from elsewhere, where the settings name some. Called once, before the first step."""
        return Start()

    def finish(self) -> None:
        """Make the finished model of the trained weights. Called once, after the last step."""
        return

    @abstractmethod
    def loss(
        self, scenes: Sequence[Scene], groups: Sequence[Group], noise: torch.Generator | None
    ) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
        """Return the loss of a training step, and its named measures, `colour_measures` among them.

        Everything is a mean over groups, so that processes with a part of the groups each come to the same gradients as one.
        noise: None for a loss that is always the same.
        """

    @abstractmethod
    def predict(self, scene: Scene, target: int, inputs: Int[np.ndarray, " v"]) -> View:
        """Predict view `target` from the views `inputs`, the same every time; the target's pixels are not used."""

    def predict_bare(self, scene: Scene, target: int, inputs: Int[np.ndarray, " v"]) -> View:
        """Predict the same view without its `parts`, which only a test compares: whoever looks on waits for it."""
        return self.predict(scene, target, inputs)


def build(config: HeadConfig) -> Head:
    """Return an untrained head of these settings; its weights come from torch's generator."""
    return importlib.import_module(f"aug3d_core.heads.{config.name}.head").HEAD(config)


def colour_measures(
    colour: Float[Tensor, "g r 3"], truth: Float[Tensor, "g r 3"], weight: Float[Tensor, "g r 1"]
) -> dict[str, Float[Tensor, ""]]:
    """Return what training watches of every head.

    error: mean squared error. spread, truth_spread: variance of colours over the pixels of a group. brightness,
    truth_brightness: their mean. All are averaged over groups. weight: sums to 1 over each group's pixels.
    """
    spreads = [weighted_mean((x - (x * weight).sum(dim=1, keepdim=True)) ** 2, weight) for x in (colour, truth)]
    return {
        "error": weighted_mean((colour - truth) ** 2, weight),
        "spread": spreads[0],
        "truth_spread": spreads[1],
        "brightness": weighted_mean(colour, weight),
        "truth_brightness": weighted_mean(truth, weight),
    }


def weighted_mean(values: Float[Tensor, "g r 3"], weight: Float[Tensor, "g r 1"]) -> Float[Tensor, ""]:
    """Average over channels, over each group's pixels by their weight, and over groups."""
    return (values * weight).sum(dim=1).mean()


def to_8_bit(rgb: Float[np.ndarray, "*n"]) -> UInt8[np.ndarray, "*n"]:
    """Round colours in [0, 1] to 8 bits, as every answer is before it is scored."""
    return np.clip(np.rint(rgb * 255), 0, 255).astype(np.uint8)
