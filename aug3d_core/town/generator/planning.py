"""Plan a town: streets, what the blocks between them are used for, and the country around."""

from __future__ import annotations

import numpy as np

from aug3d_core.town.config import Buildings
from aug3d_core.town.generator.blocks import FILL, NEEDS_M
from aug3d_core.town.generator.estates import ESTATES
from aug3d_core.town.generator.plan import MARGIN_M, Ground, Plan, Rect
from aug3d_core.town.generator.streets import Street, blocks_between, draw_streets, on_street, place_streets

_DECKS = {
    "mixed": [
        "houses",
        "flats",
        "rows",
        "park",
        "houses",
        "hall",
        "rows",
        "houses",
        "flats",
        "rows",
        "houses",
        "houses",
    ],
    "suburb": ["houses", "houses", "houses", "park", "houses", "houses", "rows", "houses"],
    "dense": ["rows", "flats", "rows", "rows", "flats", "park"],
    "industry": ["hall", "hall", "hall", "flats", "hall", "park"],
}


def make_plan(length_m: float, width_m: float, rng: np.random.Generator, buildings: Buildings = "mixed") -> Plan:
    """Lay out streets and fill every block between them."""
    plan = Plan()
    across = place_streets(length_m, 50.0, rng)  # run north-south, at these x
    along = place_streets(width_m, 40.0, rng)  # run east-west, at these y
    _country(plan, length_m, width_m, across, along, rng)
    blocks = blocks_between(length_m, width_m, across, along)
    for block in blocks:
        plan.rect(Ground.LAWN, *block)
    draw_streets(plan, length_m, width_m, across, along, rng)
    if buildings in ESTATES:
        for block in blocks:
            ESTATES[buildings](plan, block, rng)
        return plan
    for block, use in zip(blocks, _uses(_DECKS[buildings], len(blocks), rng), strict=True):
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
            if not (on_street(at[0], across) or on_street(at[1], along)):
                plan.tree(*at, rng, (2.0, 4.0))

    for side in (-1, 1):
        for start in np.arange(-x - MARGIN_M, x + MARGIN_M, 38.0):
            kind = Ground.FIELD if rng.random() < 0.45 else Ground.FOREST if rng.random() < 0.3 else Ground.MEADOW
            near, far = sorted((side * (y + 7), side * (y + MARGIN_M)))
            end = min(start + 37, x + MARGIN_M)
            plan.rect(kind, start, near, end, far)
            trees({Ground.FOREST: 16, Ground.MEADOW: 3}.get(kind, 0), start, end, near, far)
            if not on_street(end, across):
                plan.hedges.append(Rect(end - 0.7, near, end + 0.7, far))
        low, high = sorted((side * (x + 4), side * (x + MARGIN_M)))
        trees(22, low, high, -y, y)
        track = side * (x + rng.uniform(14, 20))
        plan.rect(Ground.GRAVEL, track, -y - MARGIN_M, track + 2.4, y + MARGIN_M)
        low, high = sorted((track + side * 6, track + side * 32))
        plan.rect(Ground.FIELD, low, -y * 0.8, high, -2)


def _uses(deck: list[str], count: int, rng: np.random.Generator) -> list[str]:
    """Deal out what blocks are used for: some of everything in the deck."""
    dealt = (deck * (count // len(deck) + 1))[:count]
    return [str(use) for use in rng.permutation(dealt)]
