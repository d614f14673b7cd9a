"""A surface z(x, y): a plane, and where it needs one a cubic spline on top. Its height, and where rays meet it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.interpolate import NdBSpline

Kind = Literal["level", "tilted", "smooth"]

_STEPS = 64
_HALVINGS = 40


@dataclass(frozen=True)
class GroundModel:
    """The height of the ground above a place: a plane, and for the smooth kind a spline on top of it.

    kind: level, tilted or smooth. plane: (a, b, c) of z = a x + b y + c. bumps: height of the spline over the plane in
    the fitted box, beyond which its rim goes on. box: that box, (west, south), (east, north). error: median distance
    of held-out ground to the surface. All in world units.
    """

    kind: Kind
    plane: Float[np.ndarray, " 3"]
    bumps: Float[np.ndarray, "kx ky"] | None
    box: Float[np.ndarray, "2 2"]
    error: float

    def height_at(self, xy: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, " *n"]:
        """Return the height (z) of the ground at places."""
        flat = xy.reshape(-1, 2)
        height = flat @ self.plane[:2] + self.plane[2]
        if self._spline is not None:
            height = height + self._spline(flat.clip(*self.box))
        return height.reshape(xy.shape[:-1])

    def meet(self, origins: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
        """Return where rays meet the ground, in lengths of their direction.

        inf for rays that start under it, and for those at or above the horizon of its plane.
        """
        above = origins[:, 2] - self.height_at(origins[:, :2])
        clearance = origins[:, 2] - origins[:, :2] @ self.plane[:2] - self.plane[2]
        sinking = directions[:, :2] @ self.plane[:2] - directions[:, 2]
        meets = (above > 0) & (sinking > 0)
        distance = np.full(len(origins), np.inf)
        distance[meets] = clearance[meets] / sinking[meets]
        if self._spline is not None and meets.any():
            distance[meets] = self._march(origins[meets], directions[meets], clearance[meets], sinking[meets])
        return distance

    @cached_property
    def _spline(self) -> NdBSpline | None:
        return None if self.bumps is None else NdBSpline(knots(self.box, self.bumps.shape), self.bumps, 3)

    def _march(
        self, origins: np.ndarray, directions: np.ndarray, clearance: np.ndarray, sinking: np.ndarray
    ) -> Float[np.ndarray, " m"]:
        """Step through the layer that holds the bumps, and halve the first step that goes under the ground.

        A spline lies between its smallest and largest coefficient, which bound the layer.
        """
        assert self.bumps is not None

        def above(distance: np.ndarray) -> np.ndarray:
            at = origins + distance[:, None] * directions
            return at[:, 2] - self.height_at(at[:, :2])

        near = np.maximum(0.0, (clearance - self.bumps.max()) / sinking)
        far = (clearance - self.bumps.min()) / sinking
        step = (far - near) / _STEPS
        over = near.copy()
        under = np.zeros(len(near), bool)
        for _ in range(_STEPS):
            under |= above(over + step) <= 0
            over = np.where(under, over, over + step)
        for _ in range(_HALVINGS):
            step = step / 2
            over = np.where(above(over + step) > 0, over + step, over)
        return over


def knots(box: Float[np.ndarray, "2 2"], shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return clamped cubic knots along both axes, evenly spaced."""
    inner = [np.linspace(low, high, n - 2) for (low, high), n in zip(box.T, shape, strict=True)]
    x, y = (np.concatenate([np.full(3, u[0]), u, np.full(3, u[-1])]) for u in inner)
    return x, y
