"""The ground of a large scene in tiles of about equal numbers of samples: points, or pixels of depth maps.

Memory and detail then depend on a tile, not on the scene. The ground's plane is x and y, since the world's z points up.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

BULK = (0.01, 0.99)  # quantiles between which the ground is measured: strays do not count


@dataclass(frozen=True)
class Tile:
    """A rectangle of ground, [low, high) in x and y, world units; what has no neighbour on a side goes on for ever there."""

    low: tuple[float, float] = (-np.inf, -np.inf)
    high: tuple[float, float] = (np.inf, np.inf)

    def holds(self, xyz: Float[np.ndarray, "p 3"]) -> Bool[np.ndarray, " p"]:
        """Tell which points lie over the rectangle; what is not finite lies nowhere."""
        inside = (xyz[:, :2] >= self.low) & (xyz[:, :2] < self.high)
        return inside.all(axis=1) & np.isfinite(xyz).all(axis=1)

    def grown(self, by: float) -> Tile:
        """Return the rectangle with so much more on every side; less if negative."""
        (left, front), (right, back) = self.low, self.high
        return Tile((left - by, front - by), (right + by, back + by))

    def halves(self, axis: int, at: float) -> tuple[Tile, Tile]:
        """Return the parts below and above a border across x (0) or y (1)."""
        low, high = list(self.low), list(self.high)
        low[axis] = high[axis] = at
        return Tile(self.low, (high[0], high[1])), Tile((low[0], low[1]), self.high)


EVERYWHERE = Tile()


@dataclass(frozen=True)
class Halved:
    """Ground in two parts, each a tile or halved again, that meet where x (axis 0) or y (1) is `at`."""

    ground: Tile
    axis: int
    at: float
    below: Halved | Planned
    above: Halved | Planned


@dataclass(frozen=True)
class Planned:
    """A tile, and about how far its samples are apart, world units."""

    ground: Tile
    spacing: float


def leaves(plan: Halved | Planned) -> Iterator[Planned]:
    """Yield the tiles of a plan, in their order."""
    if isinstance(plan, Planned):
        yield plan
    else:
        yield from leaves(plan.below)
        yield from leaves(plan.above)


def halve(xy: Float[np.ndarray, "s 2"], each: int, most: int, ground: Tile = EVERYWHERE) -> Halved | Planned:
    """Halve the ground across its longer side, until at most about `most` of what the samples stand for are in a tile.

    Halving at medians gives every tile as many, and keeps tiles from getting long. xy: finite samples, each of which stands
    for `each`; where none is, or no border parts them, one tile is left.
    """
    if not len(xy):
        return Planned(ground, 0.0)
    sides = np.ptp(np.quantile(xy, BULK, axis=0), axis=0)
    axis = int(sides.argmax())
    at = float(np.median(xy[:, axis]))
    below = xy[:, axis] < at
    if len(xy) * each <= most or below.all() or not below.any():
        return Planned(ground, float(np.sqrt(sides.prod() / (len(xy) * each))))
    first, second = ground.halves(axis, at)
    return Halved(ground, axis, at, halve(xy[below], each, most, first), halve(xy[~below], each, most, second))
