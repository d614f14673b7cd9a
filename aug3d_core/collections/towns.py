"""Towns by number, as members of a collection."""

from __future__ import annotations

from collections.abc import Iterator

from aug3d_core.factory.build import Work, work_of
from aug3d_core.town.exact.declared import EXACT_TOWN
from aug3d_core.town.exact.draw import drawn_town


def town_name(seed: int, number: int) -> str:
    """Name of a town; sorts by number."""
    return f"town-{seed}-{number:05d}"


def town_works(count: int, seed: int, width_px: int) -> Iterator[tuple[str, Work]]:
    """Yield the name of each town, and what is to be built."""
    for number in range(count):
        yield town_name(seed, number), work_of(EXACT_TOWN, drawn_town(seed, number, width_px), {})
