"""Every perturbation of the study, in the order of the factory."""

from __future__ import annotations

from collections.abc import Sequence

from aug3d_core.studies.common.cell import Cell
from aug3d_core.studies.common.words import picked
from aug3d_core.studies.stability.cell import Dosed
from aug3d_core.studies.stability.perturbation import Perturbation
from aug3d_core.studies.stability.perturbations import (
    boxes,
    edge_cases,
    ground,
    groups,
    learning,
    photographs,
    positions,
    surface,
    virtual_views,
)

PERTURBATIONS: tuple[Perturbation, ...] = (
    *photographs.PERTURBATIONS,
    *positions.PERTURBATIONS,
    *ground.PERTURBATIONS,
    *edge_cases.PERTURBATIONS,
    *groups.PERTURBATIONS,
    *surface.PERTURBATIONS,
    *boxes.PERTURBATIONS,
    *virtual_views.PERTURBATIONS,
    *learning.PERTURBATIONS,
)


def chosen(only: Sequence[str], quick: bool) -> list[Perturbation]:
    """Return the perturbations with words that begin as given, or those of a size; raises UsageError for unknown words."""
    if not only:
        return [perturbation for perturbation in PERTURBATIONS if perturbation.quick or not quick]
    wanted = picked("perturbation", [p.name for p in PERTURBATIONS], only)
    return [p for p in PERTURBATIONS if p.name in wanted]


def cells_of(perturbations: Sequence[Perturbation], seeds: int, quick: bool) -> list[Cell[Dosed]]:
    """Return every cell, seed after seed, so that an early look sees them all; quick: the first dose and the last."""
    return [
        Cell(Dosed(perturbation, dose, method), seed)
        for seed in range(seeds)
        for perturbation in perturbations
        for method in perturbation.methods
        for dose in (perturbation.doses[:: len(perturbation.doses) - 1] if quick else perturbation.doses)
    ]


def size_of(only: Sequence[str], quick: bool) -> str:
    """Return the name of the study's size."""
    return "chosen" if only else "quick" if quick else "full"
