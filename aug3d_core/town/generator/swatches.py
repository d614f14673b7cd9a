"""Small patches of material that many objects share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from aug3d_core.town.generator.atlas import Atlas
from aug3d_core.town.generator.noise import fractal

_CARS = (
    (0.86, 0.86, 0.86), (0.74, 0.75, 0.77), (0.16, 0.16, 0.18), (0.36, 0.38, 0.41), (0.52, 0.13, 0.13),
    (0.17, 0.25, 0.42),
    (0.80, 0.80, 0.76), (0.22, 0.34, 0.30), (0.64, 0.60, 0.52), (0.08, 0.08, 0.09), (0.90, 0.90, 0.89),
)  # fmt: skip
_LEAVES = (
    (0.29, 0.38, 0.15),
    (0.35, 0.42, 0.17),
    (0.24, 0.34, 0.14),
    (0.40, 0.43, 0.18),
    (0.30, 0.36, 0.20),
    (0.45, 0.40, 0.16),
)
_NEEDLES = ((0.18, 0.28, 0.17), (0.21, 0.30, 0.21))


@dataclass(frozen=True)
class Swatches:
    """Patch numbers by material."""

    leaves: tuple[int, ...]
    needles: tuple[int, ...]
    cars: tuple[int, ...]
    glass: int
    dark: int
    bark: int
    brick: int
    metal: int
    concrete: int


def add_swatches(atlas: Atlas, rng: np.random.Generator) -> Swatches:
    """Paint the shared materials into the atlas."""

    def add(colour: tuple[float, float, float], grain: float, px: int = 48) -> int:
        return atlas.add(_swatch(colour, grain, px, rng))

    return Swatches(
        leaves=tuple(add(c, 0.22, 96) for c in _LEAVES),
        needles=tuple(add(c, 0.24, 96) for c in _NEEDLES),
        cars=tuple(add(c, 0.015) for c in _CARS),
        glass=add((0.11, 0.13, 0.16), 0.10),
        dark=add((0.07, 0.07, 0.08), 0.1),
        bark=add((0.30, 0.24, 0.18), 0.2),
        brick=add((0.50, 0.29, 0.23), 0.16),
        metal=add((0.63, 0.65, 0.67), 0.08),
        concrete=add((0.70, 0.69, 0.66), 0.06),
    )


def _swatch(
    colour: tuple[float, float, float], grain: float, px: int, rng: np.random.Generator
) -> UInt8[np.ndarray, "h w 3"]:
    light = 1 + grain * fractal((px, px), [1, 3, 9], rng)
    tint = 1 + 0.3 * grain * fractal((px, px), [5], rng)[..., None] * np.array([1.0, 0.2, -0.8])
    return np.rint(np.clip(np.array(colour) * light[..., None] * tint, 0, 1) * 255).astype(np.uint8)
