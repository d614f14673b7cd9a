"""The ground of a large scene in tiles of about equal numbers of points, each read with a margin around it.

Memory and detail then depend on a tile, not on the scene: the points of one tile are held at a time, and its octree is as fine
as its own points allow. The ground's plane is x and y, since the world's z points up.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from aug3d_core.geometry.fused import Fused

# Three million points take 2 GiB (0.7 KiB each at cells of two spacings, measured), and lie on about 1,700 x 1,700 of their
# spacings: the deepest octree has cells for 3,700
MOST_POINTS = 3_000_000
SAMPLE = 200_000  # points that tell where to halve the ground
PART = 1_000_000  # points that are read at a time
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
    """A tile of points, and about how far they are apart, world units."""

    ground: Tile
    spacing: float

    def read(self, path: Path, margin: float) -> Fused:
        """Read the tile's points and those within a margin (world units) around it."""
        around = self.ground.grown(margin)
        names, parts = [field.name for field in fields(Fused)], []
        for part in Fused.parts(path, PART):
            inside = around.holds(part.xyz)
            parts.append([getattr(part, name)[inside] for name in names])
        return Fused(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def plan_tiles(path: Path, count: int, most: int) -> Halved | Planned:
    """Halve the ground under `count` stored points, across its longer side, until about `most` points at most are in a tile.

    Halving at medians gives every tile as many points, and keeps tiles from getting long.
    """
    step = -(-count // SAMPLE)
    taken, first = [], 0
    for part in Fused.parts(path, PART):
        taken.append(part.xyz[-first % step :: step])
        first += len(part.xyz)
    sample = np.concatenate(taken).astype(np.float64)
    return _plan(sample[np.isfinite(sample).all(axis=1), :2], EVERYWHERE, step, most)


def leaves(plan: Halved | Planned) -> Iterator[Planned]:
    """Yield the tiles of a plan, in their order."""
    if isinstance(plan, Planned):
        yield plan
    else:
        yield from leaves(plan.below)
        yield from leaves(plan.above)


def _plan(xy: Float[np.ndarray, "s 2"], ground: Tile, each: int, most: int) -> Halved | Planned:
    """`each`: points that one of the sample stands for."""
    sides = np.ptp(np.quantile(xy, BULK, axis=0), axis=0)
    axis = int(sides.argmax())
    at = float(np.median(xy[:, axis]))
    below = xy[:, axis] < at
    if len(xy) * each <= most or below.all() or not below.any():
        return Planned(ground, float(np.sqrt(sides.prod() / (len(xy) * each))))
    first, second = ground.halves(axis, at)
    return Halved(ground, axis, at, _plan(xy[below], first, each, most), _plan(xy[~below], second, each, most))
