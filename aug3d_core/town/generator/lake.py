"""A lake in the town: an ellipse of water without any lasting texture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aug3d_core.town.generator.plan import Ground, Plan

_BANK_M = 3.0  # kept free of what stands on the ground


@dataclass(frozen=True)
class Lake:
    """Centre and half axes in the plan (m)."""

    x: float
    y: float
    half_x_m: float
    half_y_m: float

    def beyond_m(self, x: Float[np.ndarray, "*n"], y: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"] | float:
        """Return about how far outside the shore points are; negative on the water."""
        reach = np.hypot((x - self.x) / self.half_x_m, (y - self.y) / self.half_y_m)
        return (reach - 1) * min(self.half_x_m, self.half_y_m)

    def flood(self, plan: Plan) -> None:
        """Paint the water over the plan and remove what stood there, in place."""
        plan.disc(Ground.SAND, self.x, self.y, self.half_x_m + 1.5, (self.half_y_m + 1.5) / (self.half_x_m + 1.5))
        plan.disc(Ground.LAKE, self.x, self.y, self.half_x_m, self.half_y_m / self.half_x_m)
        plan.buildings = [
            b for b in plan.buildings if self._dry(b.frame.x, b.frame.y, float(np.hypot(b.width_m, b.depth_m)) / 2)
        ]
        plan.trees = [t for t in plan.trees if self._dry(t.x, t.y, t.radius_m)]
        plan.cars = [c for c in plan.cars if self._dry(c.x, c.y, 2.5)]
        plan.hedges = [h for h in plan.hedges if all(self._dry(*corner, 0.0) for corner in _outline(h))]

    def _dry(self, x: float, y: float, radius_m: float) -> bool:
        return bool(self.beyond_m(np.array(x), np.array(y)) > radius_m + _BANK_M)


def lake_in(length_m: float, width_m: float) -> Lake:
    """Return a lake that takes about a tenth of a town, east of its centre."""
    return Lake(0.2 * length_m, 0.0, 0.15 * length_m, 0.22 * width_m)


def _outline(rect: tuple[float, float, float, float]) -> list[tuple[float, float]]:
    x0, y0, x1, y1 = rect
    return [(x, y) for x in np.linspace(x0, x1, 9) for y in np.linspace(y0, y1, 9)]
