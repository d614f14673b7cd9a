"""Streets: where they run, and how they are painted and lined with trees and cars."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from aug3d_core.town.generator.model import Frame
from aug3d_core.town.generator.plan import KERB_M, MARGIN_M, Ground, Plan, Rect, Tree

_PAVEMENT_M = 2.0


class Street(NamedTuple):
    """A straight street: its centre line's coordinate across, and half the carriageway's width."""

    at: float
    half_m: float


def place_streets(extent_m: float, spacing_m: float, rng: np.random.Generator) -> list[Street]:
    """Place parallel streets of several widths about `spacing_m` apart."""
    count = max(1, round(extent_m / spacing_m))
    step = extent_m / count
    at = -extent_m / 2 + step * np.arange(1, count) + rng.uniform(-0.08, 0.08, count - 1) * step
    return [Street(float(a), float(rng.choice([3.0, 3.4, 4.2]))) for a in at]


def on_street(at: float, streets: list[Street]) -> bool:
    """Tell whether a coordinate across the streets lies on or close to one."""
    return any(abs(at - s.at) < s.half_m + 1.5 for s in streets)


def blocks_between(length_m: float, width_m: float, across: list[Street], along: list[Street]) -> list[Rect]:
    """Return the blocks that the streets and their pavements leave."""
    return [Rect(x0, y0, x1, y1) for x0, x1 in _between(length_m, across) for y0, y1 in _between(width_m, along)]


def _between(extent_m: float, streets: list[Street]) -> list[tuple[float, float]]:
    starts = [-extent_m / 2] + [s.at + s.half_m + _PAVEMENT_M for s in streets]
    ends = [s.at - s.half_m - _PAVEMENT_M for s in streets] + [extent_m / 2]
    return list(zip(starts, ends, strict=True))


def draw_streets(
    plan: Plan, length_m: float, width_m: float, across: list[Street], along: list[Street], rng: np.random.Generator
) -> None:
    """Paint carriageways, kerbs, pavements and markings, out into the country, and line them with trees and cars."""
    x, y = length_m / 2, width_m / 2
    bands = ((Ground.PAVEMENT, _PAVEMENT_M, 0.0), (Ground.KERB, KERB_M, MARGIN_M), (Ground.ASPHALT, 0.0, MARGIN_M))
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
