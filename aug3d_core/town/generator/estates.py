"""Blocks that make reconstruction hard: towers that hide what is behind them, and one house repeated to the pixel."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from aug3d_core.town.generator.blocks import car_park
from aug3d_core.town.generator.model import Frame
from aug3d_core.town.generator.plan import Building, Ground, Plan, Rect

_TOWER_M = 15.0
_STOREYS = (7, 11)  # up to 33 m: under a flight at 55 m a roof is 22 m away
_HOUSE_M = (9.0, 9.0)  # width, depth


def _towers(plan: Plan, block: Rect, rng: np.random.Generator) -> None:
    """As many towers as fit with room between them, over lawn, trees and a car park."""
    along = max(1, int((block.x1 - block.x0) / 26))
    x_step = (block.x1 - block.x0) / along
    deep = block.y1 - block.y0
    north = block.y1 - min(deep / 2, 4 + _TOWER_M / 2)
    for i in range(along):
        x = block.x0 + (i + 0.5) * x_step + rng.uniform(-2, 2)
        width, depth = (float(side) for side in _TOWER_M * rng.uniform(0.85, 1.1, 2))
        storeys = int(rng.integers(_STOREYS[0], _STOREYS[1] + 1))
        frame = Frame(x, north, float(rng.choice([0.0, np.pi / 2])))
        plan.buildings.append(Building(frame, width, depth, 3.0 * storeys + 0.4, "flat", 0, "flats"))
        plan.strip(Ground.PAVEMENT, (x, block.y0), (x, north), 1.8)
    if deep > _TOWER_M + 20:
        car_park(plan, Rect(block.x0 + 4, block.y0 + 1, block.x1 - 4, block.y0 + 11.5), rng)
    for _ in range(8):
        y = rng.uniform(block.y0 + 2, max(block.y0 + 3, north - _TOWER_M / 2 - 3))
        plan.tree(rng.uniform(block.x0 + 2, block.x1 - 2), y, rng, (1.2, 2.2))


def _repeated(plan: Plan, block: Rect, rng: np.random.Generator) -> None:
    """Two rows of one house at one distance, each with the same path, terrace and hedge."""
    width, depth = _HOUSE_M
    count = max(1, int((block.x1 - block.x0) / (width + 4)))
    step = (block.x1 - block.x0) / count
    for front, inward in ((block.y0, 1), (block.y1, -1)):
        y = front + inward * (3 + depth / 2)
        for i in range(count):
            x = block.x0 + (i + 0.5) * step
            plan.buildings.append(
                Building(Frame(x, y, 0.0 if inward > 0 else np.pi), width, depth, 5.8, "gable", 36, "house")
            )
            plan.strip(Ground.PAVEMENT, (x, front), (x, y), 1.2)
            low, high = sorted((y + inward * depth / 2, y + inward * (depth / 2 + 2.5)))
            plan.rect(Ground.TERRACE, x - 3, low, x + 3, high)
            low, high = sorted((front + inward * 4, front + inward * (6 + depth)))
            plan.hedges.append(Rect(x + step / 2 - 0.4, low, x + step / 2 + 0.4, high))


ESTATES: dict[str, Callable[[Plan, Rect, np.random.Generator], None]] = {"high_rise": _towers, "identical": _repeated}
