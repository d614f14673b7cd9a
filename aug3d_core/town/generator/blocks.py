"""What stands in a block: houses in gardens, rows of town houses, flats, a shop hall, or a park."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from aug3d_core.town.generator.model import Frame
from aug3d_core.town.generator.plan import KERB_M, Building, Ground, Plan, Rect, Roof, Tree

_HOUSE_ROOFS: tuple[Roof, ...] = ("gable", "gable", "hip", "hip", "flat")


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
            plan.tree(rng.uniform(at, span[1] - 1), y, rng, (1.3, 2.5))


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
                plan.tree(x + width / 2, front + inward * (depth + rng.uniform(4, 5.5)), rng, (1.2, 2.2))
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
    car_park(plan, Rect(block.x0 + 4, block.y0 + 1, block.x1 - 4, block.y0 + 11.5), rng)
    plan.strip(Ground.PAVEMENT, (x, block.y0 + 11), (x, y), 1.8)
    plan.strip(Ground.PAVEMENT, (block.x0, y - depth / 2 - 1.4), (block.x1, y - depth / 2 - 1.4), 1.5)
    for _ in range(7):
        plan.tree(
            rng.uniform(block.x0 + 2, block.x1 - 2),
            rng.uniform(block.y0 + 12, y - depth / 2 - 2),
            rng,
            (1.2, 1.9),
        )
    for side in (block.x0 + 1.8, block.x1 - 1.8):
        for _ in range(3):
            plan.tree(side, rng.uniform(block.y0 + 13, block.y1 - 2), rng, (1.5, 2.4))


def car_park(plan: Plan, area: Rect, rng: np.random.Generator) -> None:
    """Asphalt with a lane and marked bays on the north side, and on both if there is room."""
    plan.rect(Ground.KERB, *area.grown(KERB_M))
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
    car_park(plan, Rect(block.x0 + 1.5, block.y0 + 1.5, block.x1 - 1.5, y - depth / 2 - 2.2), rng)
    for tree in np.linspace(block.x0 + 3, block.x1 - 3, 4):
        plan.tree(tree, block.y0 + 0.9, rng, (1.0, 1.7))


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
            plan.tree(tx, ty, rng, (2.0, 3.6))


NEEDS_M = {"houses": 0.0, "rows": 24.0, "flats": 30.0, "hall": 26.0, "park": 20.0}  # north-south size of a block
FILL = {"houses": _houses, "rows": _rows, "flats": _flats, "hall": _hall, "park": _park}
