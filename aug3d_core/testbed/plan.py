"""What stands where: a flat, right-angled town, from -length/2 to length/2 (x) and -width/2 to width/2 (y), in metres.

`town.py` turns and bends it afterwards. A plan is only lists; it knows neither textures nor triangles.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from aug3d_core.testbed.model import Frame

MARGIN_M = 60.0  # open country around the town, so that photographs of its edge show ground
_PAVEMENT_M = 2.0
_KERB_M = 0.18

Corners = Sequence[tuple[float, float]]
Roof = Literal["gable", "hip", "flat"]
_HOUSE_ROOFS: tuple[Roof, ...] = ("gable", "gable", "hip", "hip", "flat")


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


class Street(NamedTuple):
    """A straight street: its centre line's coordinate across, and half the carriageway's width."""

    at: float
    half_m: float


def make_plan(length_m: float, width_m: float, rng: np.random.Generator) -> Plan:
    """Lay out streets and fill every block between them."""
    plan = Plan()
    across = _streets(length_m, 50.0, rng)  # run north-south, at these x
    along = _streets(width_m, 40.0, rng)  # run east-west, at these y
    _country(plan, length_m, width_m, across, along, rng)
    blocks = _blocks(length_m, width_m, across, along)
    for block in blocks:
        plan.rect(Ground.LAWN, *block)
    _draw_streets(plan, length_m, width_m, across, along, rng)
    for block, use in zip(blocks, _uses(len(blocks), rng), strict=True):
        FILL[use if block.y1 - block.y0 > NEEDS_M[use] else "houses"](plan, block, rng)
    return plan


def _country(
    plan: Plan, length_m: float, width_m: float, across: list[Street], along: list[Street], rng: np.random.Generator
) -> None:
    """Surround the town with fields, meadows and woods, and keep its streets' ends free."""
    x, y = length_m / 2, width_m / 2

    def trees(count: int, x0: float, x1: float, y0: float, y1: float) -> None:
        for _ in range(count):
            at = rng.uniform(x0, x1), rng.uniform(y0, y1)
            if not (_on_street(at[0], across) or _on_street(at[1], along)):
                _tree(plan, *at, rng, (2.0, 4.0))

    for side in (-1, 1):
        for start in np.arange(-x - MARGIN_M, x + MARGIN_M, 38.0):
            kind = Ground.FIELD if rng.random() < 0.45 else Ground.FOREST if rng.random() < 0.3 else Ground.MEADOW
            near, far = sorted((side * (y + 7), side * (y + MARGIN_M)))
            end = min(start + 37, x + MARGIN_M)
            plan.rect(kind, start, near, end, far)
            trees({Ground.FOREST: 16, Ground.MEADOW: 3}.get(kind, 0), start, end, near, far)
            if not _on_street(end, across):
                plan.hedges.append(Rect(end - 0.7, near, end + 0.7, far))
        low, high = sorted((side * (x + 4), side * (x + MARGIN_M)))
        trees(22, low, high, -y, y)
        track = side * (x + rng.uniform(14, 20))
        plan.rect(Ground.GRAVEL, track, -y - MARGIN_M, track + 2.4, y + MARGIN_M)
        low, high = sorted((track + side * 6, track + side * 32))
        plan.rect(Ground.FIELD, low, -y * 0.8, high, -2)


def _on_street(at: float, streets: list[Street]) -> bool:
    return any(abs(at - s.at) < s.half_m + 1.5 for s in streets)


def _tree(plan: Plan, x: float, y: float, rng: np.random.Generator, radius_m: tuple[float, float]) -> None:
    radius = rng.uniform(*radius_m)
    kind = "cone" if rng.random() < 0.2 else "round"
    if kind == "cone":
        radius *= 0.7
    plan.trees.append(Tree(x, y, radius, radius * rng.uniform(2.1, 2.8) * (1.5 if kind == "cone" else 1), kind))


def _streets(extent_m: float, spacing_m: float, rng: np.random.Generator) -> list[Street]:
    count = max(1, round(extent_m / spacing_m))
    step = extent_m / count
    at = -extent_m / 2 + step * np.arange(1, count) + rng.uniform(-0.08, 0.08, count - 1) * step
    return [Street(float(a), float(rng.choice([3.0, 3.4, 4.2]))) for a in at]


def _blocks(length_m: float, width_m: float, across: list[Street], along: list[Street]) -> list[Rect]:
    return [Rect(x0, y0, x1, y1) for x0, x1 in _between(length_m, across) for y0, y1 in _between(width_m, along)]


def _between(extent_m: float, streets: list[Street]) -> list[tuple[float, float]]:
    starts = [-extent_m / 2] + [s.at + s.half_m + _PAVEMENT_M for s in streets]
    ends = [s.at - s.half_m - _PAVEMENT_M for s in streets] + [extent_m / 2]
    return list(zip(starts, ends, strict=True))


def _draw_streets(
    plan: Plan, length_m: float, width_m: float, across: list[Street], along: list[Street], rng: np.random.Generator
) -> None:
    x, y = length_m / 2, width_m / 2
    bands = ((Ground.PAVEMENT, _PAVEMENT_M, 0.0), (Ground.KERB, _KERB_M, MARGIN_M), (Ground.ASPHALT, 0.0, MARGIN_M))
    for ground, wider, longer in bands:
        for s in across:
            plan.rect(ground, s.at - s.half_m - wider, -y - longer, s.at + s.half_m + wider, y + longer)
        for s in along:
            plan.rect(ground, -x - longer, s.at - s.half_m - wider, x + longer, s.at + s.half_m + wider)
    for s in across:
        _furnish(plan, s, along, y, False, rng)
    for s in along:
        _furnish(plan, s, across, x, True, rng)


def _furnish(
    plan: Plan, street: Street, crossing: list[Street], reach: float, east: bool, rng: np.random.Generator
) -> None:
    """Mark, patch and line with trees and cars one street, written as running along u, with v across."""

    def rect(ground: Ground, u0: float, v0: float, u1: float, v1: float) -> None:
        plan.rect(ground, *((u0, v0, u1, v1) if east else (v0, u0, v1, u1)))

    starts = [-reach, *(c.at + c.half_m for c in crossing)]
    ends = [*(c.at - c.half_m for c in crossing), reach]
    v, half = street.at, street.half_m
    for start, end in zip(starts, ends, strict=True):
        for _ in range(int((end - start) / 9)):  # repairs, manholes
            u, w = rng.uniform(start, end), v + rng.uniform(-half + 0.8, half - 2.2)
            rect(Ground.PATCHED, u, w, u + rng.uniform(0.8, 6), w + rng.uniform(0.6, 1.6))
            u, w = rng.uniform(start, end), v + rng.uniform(-half + 0.8, half - 0.8)
            plan.disc(Ground.IRON, *((u, w) if east else (w, u)), 0.35)
        for u in np.arange(start + 5.5, end - 7, 4.5):
            rect(Ground.PAINT, u, v - 0.09, u + 2.2, v + 0.09)
        for side, u in ((-1, start), (1, end)):
            if abs(u) < reach:
                _crossing(rect, u, v, half, -side)
        for side in (-1, 1):
            _line_with_trees_and_cars(plan, street, (start, end), side, east, rng)


def _crossing(rect: Callable[..., None], u: float, v: float, half: float, inward: int) -> None:
    """Paint a zebra crossing and a stop line at a street's mouth."""
    near, far = sorted((u + inward * 1.0, u + inward * 3.6))
    for w in np.arange(v - half + 0.4, v + half - 0.5, 1.0):
        rect(Ground.PAINT, near, w, far, w + 0.5)
    low, high = sorted((u + inward * 4.6, u + inward * 5.0))
    rect(Ground.PAINT, low, min(v, v - inward * (half - 0.3)), high, max(v, v - inward * (half - 0.3)))


def _line_with_trees_and_cars(
    plan: Plan, street: Street, span: tuple[float, float], side: int, east: bool, rng: np.random.Generator
) -> None:
    start, end = span
    for u in np.arange(start + 9, end - 8, 11.0):
        if rng.random() < 0.6:
            x, y = (
                (u, street.at + side * (street.half_m + 1.0)) if east else (street.at + side * (street.half_m + 1.0), u)
            )
            plan.rect(Ground.SOIL, x - 0.7, y - 0.7, x + 0.7, y + 0.7)
            plan.trees.append(Tree(x, y, rng.uniform(1.4, 2.3), rng.uniform(5, 7.5), "round"))
    for u in np.arange(start + 9, end - 9, 6.0):
        if rng.random() < 0.33:
            w = street.at + side * (street.half_m - 1.05)
            yaw = rng.normal(0, 0.02) + (0 if east else np.pi / 2) + (np.pi if rng.random() < 0.5 else 0)
            shift = rng.uniform(-0.5, 0.5)
            plan.cars.append(Frame(u + shift, w, yaw) if east else Frame(w, u + shift, yaw))


def _uses(count: int, rng: np.random.Generator) -> list[str]:
    """Deal out what blocks are used for: some of everything, houses the most."""
    deck = ["houses", "flats", "rows", "park", "houses", "hall", "rows", "houses", "flats", "rows", "houses", "houses"]
    dealt = (deck * (count // len(deck) + 1))[:count]
    return [str(use) for use in rng.permutation(dealt)]


def _houses(plan: Plan, block: Rect, rng: np.random.Generator) -> None:
    """Two rows of detached houses, back to back, each in its garden."""
    middle = (block.y0 + block.y1) / 2
    lots = max(1, int((block.x1 - block.x0) / 15.5))
    edges = np.linspace(block.x0, block.x1, lots + 1)
    for x0, x1 in pairwise(edges):
        for front, back in ((block.y0, middle), (block.y1, middle)):
            _house(plan, (x0, x1), front, back, rng)
        plan.hedges.append(Rect(x1 - 0.4, block.y0 + 4, x1 + 0.4, block.y1 - 4))
    plan.hedges.append(Rect(block.x0 + 1, middle - 0.5, block.x1 - 1, middle + 0.5))


def _house(plan: Plan, span: tuple[float, float], front: float, back: float, rng: np.random.Generator) -> None:
    inward = np.sign(back - front)
    room = span[1] - span[0]
    width = min(rng.uniform(8.5, 11.5), room - 4.2)
    depth = min(rng.uniform(7.5, 9.5), abs(back - front) - 7)
    x = span[0] + 1.2 + width / 2 + rng.uniform(0, 0.5)
    y = front + inward * (rng.uniform(3.0, 4.2) + depth / 2)
    turned = rng.random() < 0.35
    frame = Frame(x, y, rng.normal(0, 0.02) + (np.pi / 2 if turned else 0) + (np.pi if inward < 0 else 0))
    wide, deep = (depth, width) if turned else (width, depth)
    roof = _HOUSE_ROOFS[rng.integers(len(_HOUSE_ROOFS))]
    pitch = rng.uniform(28, 42) if roof == "gable" else rng.uniform(22, 32)
    plan.buildings.append(Building(frame, wide, deep, rng.choice([3.2, 5.4, 5.8]), roof, pitch, "house"))
    drive = span[1] - 2.9
    low, high = sorted((front, front + inward * (depth + 3)))
    plan.rect(Ground.TERRACE if rng.random() < 0.5 else Ground.GRAVEL, drive, low, drive + 2.5, high)
    if rng.random() < 0.75:
        plan.cars.append(Frame(drive + 1.25, front + inward * rng.uniform(3, 5.5), np.pi / 2 + rng.normal(0, 0.04)))
    plan.strip(Ground.PAVEMENT, (x, front), (x, y), 1.1)
    _garden(plan, span, y + inward * depth / 2, back, rng)


def _garden(plan: Plan, span: tuple[float, float], wall: float, back: float, rng: np.random.Generator) -> None:
    inward = np.sign(back - wall)
    at = (span[0] + span[1]) / 2
    low, high = sorted((wall, wall + inward * rng.uniform(2.0, 3.2)))
    plan.rect(Ground.TERRACE, at - rng.uniform(2, 4), low, at + rng.uniform(1, 3), high)
    deep = abs(back - wall)
    if deep < 4:
        return
    spot = rng.random()
    y = back - inward * 2.2
    if spot < 0.3:
        plan.buildings.append(Building(Frame(span[0] + 2.6, y, 0.0), 3.0, 2.2, 2.1, "gable", 22, "shed"))
    elif spot < 0.5 and deep > 6:
        plan.rect(Ground.TERRACE, at - 3.6, y - 1.9, at + 3.6, y + 1.9)
        plan.rect(Ground.WATER, at - 2.9, y - 1.2, at + 2.9, y + 1.2)
    else:
        plan.rect(Ground.SOIL, span[0] + 1, y - 1.0, span[0] + rng.uniform(3, 6), y + 1.0)
    for _ in range(rng.integers(2, 6)):
        y = rng.uniform(*sorted((wall + inward * 2.5, back - inward)))
        if rng.random() < 0.5:
            plan.trees.append(
                Tree(rng.uniform(at, span[1] - 1), y, rng.uniform(0.5, 1.0), rng.uniform(0.8, 1.6), "bush")
            )
        else:
            _tree(plan, rng.uniform(at, span[1] - 1), y, rng, (1.3, 2.5))


def _rows(plan: Plan, block: Rect, rng: np.random.Generator) -> None:
    """Attached town houses along two streets, gardens and yards between them."""
    depth = min(10.0, (block.y1 - block.y0) / 2 - 5)
    for front, inward in ((block.y0, 1), (block.y1, -1)):
        x = block.x0 + 0.5
        while x < block.x1 - 6:
            width = rng.uniform(6.5, 9.5)
            width = block.x1 - 0.5 - x if block.x1 - x - width < 6 else width
            frame = Frame(x + width / 2, front + inward * (0.6 + depth / 2), np.pi if inward < 0 else 0.0)
            eaves = rng.choice([5.8, 8.4, 8.8, 11.2])
            plan.buildings.append(Building(frame, width, depth, eaves, "gable", rng.uniform(30, 45), "row"))
            low, high = sorted((front + inward * (depth + 2), front + inward * (depth + 5)))
            plan.hedges.append(Rect(x - 0.2, low, x + 0.2, high))
            low, high = sorted((front + inward * (depth + 0.6), front + inward * (depth + 2.8)))
            plan.rect(Ground.TERRACE if rng.random() < 0.6 else Ground.GRAVEL, x + 0.4, low, x + width - 0.6, high)
            if rng.random() < 0.5:
                _tree(plan, x + width / 2, front + inward * (depth + rng.uniform(4, 5.5)), rng, (1.2, 2.2))
            x += width


def _flats(plan: Plan, block: Rect, rng: np.random.Generator) -> None:
    """Blocks of flats in a lawn, with a car park along one side."""
    wide, high = block.x1 - block.x0, block.y1 - block.y0
    depth = min(12.0, high - 15)
    length = min(wide - 8, rng.uniform(26, 36))
    x, y = (block.x0 + block.x1) / 2, block.y1 - 3.5 - depth / 2
    storeys = int(rng.integers(3, 6))
    if length > 24 and rng.random() < 0.5:
        half = length / 2 - 1
        for side in (-1, 1):
            floors = storeys + (side > 0)
            frame = Frame(x + side * (half / 2 + 1.6), y, 0.0)
            plan.buildings.append(Building(frame, half, depth, 3.0 * floors + 0.4, "flat", 0, "flats"))
    else:
        plan.buildings.append(Building(Frame(x, y, 0.0), length, depth, 3.0 * storeys + 0.4, "flat", 0, "flats"))
    _car_park(plan, Rect(block.x0 + 4, block.y0 + 1, block.x1 - 4, block.y0 + 11.5), rng)
    plan.strip(Ground.PAVEMENT, (x, block.y0 + 11), (x, y), 1.8)
    plan.strip(Ground.PAVEMENT, (block.x0, y - depth / 2 - 1.4), (block.x1, y - depth / 2 - 1.4), 1.5)
    for _ in range(7):
        _tree(
            plan,
            rng.uniform(block.x0 + 2, block.x1 - 2),
            rng.uniform(block.y0 + 12, y - depth / 2 - 2),
            rng,
            (1.2, 1.9),
        )
    for side in (block.x0 + 1.8, block.x1 - 1.8):
        for _ in range(3):
            _tree(plan, side, rng.uniform(block.y0 + 13, block.y1 - 2), rng, (1.5, 2.4))


def _car_park(plan: Plan, area: Rect, rng: np.random.Generator) -> None:
    """Asphalt with a lane and marked bays on the north side, and on both if there is room."""
    plan.rect(Ground.KERB, *area.grown(_KERB_M))
    plan.rect(Ground.ASPHALT, *area)
    rows = [(area.y1 - 5.0, area.y1)] + ([(area.y0, area.y0 + 5.0)] if area.y1 - area.y0 > 14 else [])
    for y0, y1 in rows:
        for x in np.arange(area.x0 + 0.4, area.x1 - 2.6, 2.6):
            plan.rect(Ground.PAINT, x - 0.06, y0, x + 0.06, y1)
            if rng.random() < 0.6:
                yaw = np.pi / 2 * rng.choice([-1, 1]) + rng.normal(0, 0.03)
                plan.cars.append(Frame(x + 1.3, (y0 + y1) / 2 + rng.normal(0, 0.15), yaw))


def _hall(plan: Plan, block: Rect, rng: np.random.Generator) -> None:
    """A shop hall with its car park."""
    wide, high = block.x1 - block.x0, block.y1 - block.y0
    depth = high * 0.42
    x, y = (block.x0 + block.x1) / 2, block.y1 - 2 - depth / 2
    plan.rect(Ground.PAVEMENT, *block.grown(-0.6))
    plan.buildings.append(Building(Frame(x, y, 0.0), wide - 7, depth, rng.uniform(5, 7.5), "flat", 0, "hall"))
    _car_park(plan, Rect(block.x0 + 1.5, block.y0 + 1.5, block.x1 - 1.5, y - depth / 2 - 2.2), rng)
    for tree in np.linspace(block.x0 + 3, block.x1 - 3, 4):
        _tree(plan, tree, block.y0 + 0.9, rng, (1.0, 1.7))


def _park(plan: Plan, block: Rect, rng: np.random.Generator) -> None:
    """Lawn with paths, a pond, a playground and old trees."""
    x, y = (block.x0 + block.x1) / 2, (block.y0 + block.y1) / 2
    corners = block.grown(-0.5).corners
    plan.strip(Ground.GRAVEL, corners[0], corners[2], 2.2)
    plan.strip(Ground.GRAVEL, corners[1], corners[3], 2.2)
    plan.disc(Ground.GRAVEL, x, y, 5.5)
    plan.disc(Ground.SOIL, x, y, 2.4)
    pond = (x + (block.x1 - x) * 0.55, y)
    plan.disc(Ground.KERB, *pond, 5.2, 0.72)
    plan.disc(Ground.WATER, *pond, 4.8, 0.7)
    plan.rect(Ground.SAND, block.x0 + 4, y - 3.5, block.x0 + 11, y + 3.5)
    plan.buildings.append(Building(Frame(block.x0 + 7, y + 1, 0.3), 2.2, 2.2, 2.4, "hip", 30, "shed"))
    for _ in range(int((block.x1 - block.x0) * (block.y1 - block.y0) / 55)):
        tx, ty = rng.uniform(block.x0 + 2, block.x1 - 2), rng.uniform(block.y0 + 2, block.y1 - 2)
        if np.hypot(tx - pond[0], ty - pond[1]) > 7.5 and np.hypot(tx - x, ty - y) > 6:
            _tree(plan, tx, ty, rng, (2.0, 3.6))


NEEDS_M = {"houses": 0.0, "rows": 24.0, "flats": 30.0, "hall": 26.0, "park": 20.0}  # north-south size of a block
FILL = {"houses": _houses, "rows": _rows, "flats": _flats, "hall": _hall, "park": _park}
