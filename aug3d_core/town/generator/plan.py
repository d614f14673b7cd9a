"""What a plan of the town consists of: a flat, right-angled town about the origin, in metres, x east and y north.

`town.py` turns and bends it afterwards. A plan is only lists; it knows neither textures nor triangles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Literal, NamedTuple

import numpy as np

from aug3d_core.town.generator.model import Frame

MARGIN_M = 60.0  # open country around the town, so that photographs of its edge show ground
KERB_M = 0.18

Corners = Sequence[tuple[float, float]]
Roof = Literal["gable", "hip", "flat"]


class Ground(IntEnum):
    """What the ground is made of."""

    MEADOW = 0
    LAWN = 1
    ASPHALT = 2
    PAVEMENT = 3
    KERB = 4
    PAINT = 5
    GRAVEL = 6
    TERRACE = 7
    WATER = 8
    SAND = 9
    FIELD = 10
    SOIL = 11
    PATCHED = 12
    IRON = 13
    FOREST = 14
    LAKE = 15


class Rect(NamedTuple):
    """An upright rectangle."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def corners(self) -> Corners:
        return [(self.x0, self.y0), (self.x1, self.y0), (self.x1, self.y1), (self.x0, self.y1)]

    def grown(self, by: float) -> Rect:
        return Rect(self.x0 - by, self.y0 - by, self.x1 + by, self.y1 + by)


@dataclass(frozen=True)
class Building:
    """Walls of `width` (local x) by `depth` (local y), up to the eaves; the ridge runs along x."""

    frame: Frame
    width_m: float
    depth_m: float
    eaves_m: float
    roof: Roof
    pitch_deg: float
    use: Literal["house", "row", "flats", "hall", "shed"]
    bare_roof: bool = False


class Tree(NamedTuple):
    """A tree or bush: where, how wide and how high its crown is."""

    x: float
    y: float
    radius_m: float
    height_m: float
    kind: Literal["round", "cone", "bush"]


@dataclass
class Plan:
    """Everything in the town; `paint` is drawn in this order, later over earlier."""

    paint: list[tuple[Ground, Corners]] = field(default_factory=list)
    buildings: list[Building] = field(default_factory=list)
    trees: list[Tree] = field(default_factory=list)
    cars: list[Frame] = field(default_factory=list)
    hedges: list[Rect] = field(default_factory=list)

    def rect(self, ground: Ground, *sides: float) -> None:
        """Paint an upright rectangle."""
        self.paint.append((ground, Rect(*sides).corners))

    def disc(self, ground: Ground, x: float, y: float, radius_m: float, squash: float = 1.0) -> None:
        """Paint a disc."""
        turn = np.linspace(0, 2 * np.pi, 28, endpoint=False)
        self.paint.append(
            (ground, list(zip(x + radius_m * np.cos(turn), y + radius_m * squash * np.sin(turn), strict=True)))
        )

    def strip(self, ground: Ground, start: tuple[float, float], end: tuple[float, float], width_m: float) -> None:
        """Paint a straight band."""
        (ax, ay), (bx, by) = start, end
        length = np.hypot(bx - ax, by - ay)
        nx, ny = (ay - by) / length * width_m / 2, (bx - ax) / length * width_m / 2
        self.paint.append((ground, [(ax + nx, ay + ny), (bx + nx, by + ny), (bx - nx, by - ny), (ax - nx, ay - ny)]))

    def tree(self, x: float, y: float, rng: np.random.Generator, radius_m: tuple[float, float]) -> None:
        """Plant a tree of drawn kind and size."""
        radius = rng.uniform(*radius_m)
        kind = "cone" if rng.random() < 0.2 else "round"
        if kind == "cone":
            radius *= 0.7
        self.trees.append(Tree(x, y, radius, radius * rng.uniform(2.1, 2.8) * (1.5 if kind == "cone" else 1), kind))
