"""Cars, heading along local x."""

from __future__ import annotations

import numpy as np

from aug3d_core.town.generator.model import Frame, Model
from aug3d_core.town.generator.swatches import Swatches


def add_car(model: Model, swatches: Swatches, frame: Frame, rng: np.random.Generator) -> None:
    """Append a saloon, an estate or a van."""
    paint = int(swatches.cars[rng.integers(len(swatches.cars))])
    kind = rng.choice(3, p=[0.5, 0.35, 0.15])
    half, wide = rng.uniform(2.0, 2.3) + 0.3 * (kind == 2), 0.88
    belt, top = (0.86, 1.44) if kind < 2 else (1.1, 2.0)
    rear = (-half + 0.75, -half + 0.25, -half + 0.15)[kind]
    model.box(frame, (-half, -wide, 0.22), (half, wide, belt), paint, paint, taper=0.06)
    for x in (-half * 0.62, half * 0.62):
        model.box(frame, (x - 0.32, -wide - 0.02, 0.0), (x + 0.32, wide + 0.02, 0.62), swatches.dark, swatches.dark)
    front = half - (1.15 if kind < 2 else 0.8)
    _cabin(model, swatches, frame, (rear, front), wide - 0.1, (belt, top), paint, steep=kind > 0)
    for x, colour in ((half - 0.01, swatches.metal), (-half + 0.01, swatches.brick)):  # lights
        for y in (-0.6, 0.6):
            model.box(frame, (x - 0.06, y - 0.18, 0.55), (x + 0.06, y + 0.18, 0.72), colour, colour)


def _cabin(
    model: Model, swatches: Swatches, frame: Frame, along: tuple[float, float], half: float,
    levels: tuple[float, float], paint: int, steep: bool,
) -> None:  # fmt: skip
    (rear, front), (low, high) = along, levels
    back, bonnet, inward = (0.2 if steep else 0.55), 0.6, 0.14
    base = [(rear, -half, low), (front, -half, low), (front, half, low), (rear, half, low)]
    lid = [(rear + back, -half + inward, high), (front - bonnet, -half + inward, high)]
    lid += [(front - bonnet, half - inward, high), (rear + back, half - inward, high)]
    for i in range(4):
        j = (i + 1) % 4
        model.polygon(frame, [base[i], base[j], lid[j], lid[i]], swatches.glass)
    model.polygon(frame, lid, paint)
