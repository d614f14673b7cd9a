"""What a training step sees, disguised: in other colours, or as other cameras might have photographed it.

Renders are sharper, cleaner and more alike than photographs. A model that is trained on them alone is to learn neither that
roofs are red nor that what looks smooth wants sharpening.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional as F

from aug3d_core.heads.sweep.config import SweepConfig

_GAMMA, _TINT, _GAIN = 0.25, 0.08, 0.06  # spread of the logarithm of each, one standard deviation
_BLURRED, _BLUR_PX = 0.6, 0.9  # share of the steps that see everything blurred; at most so much, of a view's pixels
_MORE_BLURRED, _MORE_BLUR_PX = 0.3, 0.4  # share of the inputs that are blurred besides; one standard deviation
_NOISE = 4 / 255  # at most, in an input, one standard deviation
_LEAST_BLUR_PX = 0.15  # below, a kernel changes nothing


@dataclass(frozen=True)
class Camera:
    """How an input was photographed otherwise than the others."""

    gain: float
    blur_px: float  # of a view
    noise: float

    @classmethod
    def drawn(cls, noise: torch.Generator) -> Camera:
        """Draw one."""
        more = abs(_normal(noise, _MORE_BLUR_PX)) if _chance(noise, _MORE_BLURRED) else 0.0
        return cls(math.exp(_normal(noise, _GAIN)), more, _uniform(noise, _NOISE))


@dataclass(frozen=True)
class Disguise:
    """How a step sees its target and its inputs; as they are, by default. Colours are in [0, 1]."""

    order: tuple[int, ...] = (0, 1, 2)
    negative: bool = False
    gamma: float = 1.0
    tint: tuple[float, ...] = (1.0, 1.0, 1.0)
    blur_px: float = 0.0
    cameras: tuple[Camera, ...] = ()  # of the inputs; none: as the target
    noise: torch.Generator | None = None

    @classmethod
    def drawn(cls, config: SweepConfig, inputs: int, noise: torch.Generator | None) -> Disguise:
        """Draw one for a step with so many inputs; without noise there is none."""
        if noise is None:
            return PLAIN
        order, negative = (0, 1, 2), False
        if _chance(noise, config.recoloured_share):
            order = tuple(torch.randperm(3, generator=noise).tolist())
            negative = bool(torch.randint(2, (1,), generator=noise))
        if not _chance(noise, config.other_cameras_share):
            return cls(order, negative)
        return cls(
            order,
            negative,
            math.exp(_normal(noise, _GAMMA)),
            tuple(math.exp(_normal(noise, _TINT)) for _ in range(3)),
            _uniform(noise, _BLUR_PX) if _chance(noise, _BLURRED) else 0.0,
            tuple(Camera.drawn(noise) for _ in range(inputs)),
            noise,
        )

    def of_target(self, rgb: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w 3"]:
        """Return what is to be predicted: without an input's own faults."""
        return self._filmed(rgb[None], 1)[0]

    def of_inputs(self, rgb: Float[Tensor, "v h w 3"], finer: int = 1) -> Float[Tensor, "v h w 3"]:
        """Return what the inputs show, in images so many times finer than a view."""
        filmed = self._filmed(rgb, finer)
        if not self.cameras:
            return filmed
        return torch.cat([self._taken(*pair, finer) for pair in zip(filmed, self.cameras, strict=True)])

    def _filmed(self, rgb: Float[Tensor, "v h w 3"], finer: int) -> Float[Tensor, "v h w 3"]:
        """Change what all pictures of a step have in common."""
        rgb = (1 - rgb if self.negative else rgb)[..., list(self.order)]
        if not self.cameras:
            return rgb
        rgb = (rgb.clamp(min=0) ** self.gamma * rgb.new_tensor(self.tint)).clamp(max=1)
        return _blurred(rgb, self.blur_px * finer)

    def _taken(self, rgb: Float[Tensor, "h w 3"], camera: Camera, finer: int) -> Float[Tensor, "1 h w 3"]:
        """Change what is an input's own. A pixel of a finer image has the less light, and the more noise."""
        blurred = _blurred(rgb[None] * camera.gain, camera.blur_px * finer)
        grain = torch.randn(blurred.shape, generator=self.noise).to(rgb.device)
        return (blurred + camera.noise * math.sqrt(finer) * grain).clamp(0, 1)


PLAIN = Disguise()


def _blurred(rgb: Float[Tensor, "v h w 3"], blur_px: float) -> Float[Tensor, "v h w 3"]:
    """Return pictures under a Gaussian of a standard deviation of so many pixels."""
    if blur_px < _LEAST_BLUR_PX:
        return rgb
    reach = math.ceil(2.5 * blur_px)
    weights = torch.exp(-(torch.arange(-reach, reach + 1, device=rgb.device) ** 2) / (2 * blur_px**2))
    weights = weights / weights.sum()
    planes = rgb.movedim(-1, 1).flatten(0, 1)[:, None]
    across = F.conv2d(F.pad(planes, (reach, reach, 0, 0), mode="replicate"), weights[None, None, None])
    both = F.conv2d(F.pad(across, (0, 0, reach, reach), mode="replicate"), weights[None, None, :, None])
    return both.view(len(rgb), 3, *rgb.shape[1:3]).movedim(1, -1)


def _chance(noise: torch.Generator, share: float) -> bool:
    return share > 0 and float(torch.rand((), generator=noise)) < share


def _uniform(noise: torch.Generator, most: float) -> float:
    return most * float(torch.rand((), generator=noise))


def _normal(noise: torch.Generator, spread: float) -> float:
    return spread * float(torch.randn((), generator=noise))
