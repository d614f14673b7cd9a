"""Every cell of one of the paper's tables, judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from aug3d_core.factory.walk import Make
from aug3d_core.store.store import Store
from aug3d_core.studies.common.cell import Cell, Done, make_cells
from aug3d_core.studies.paper.arm import PaperArm, PaperTable
from aug3d_core.studies.paper.cell import PaperResult, make_cell
from aug3d_core.studies.paper.scene import FinishedScene
from aug3d_core.studies.paper.scores import score_table, whole


def make_table(
    store: Store, table: PaperTable, scene: FinishedScene, seeds: int, make: Make, done: Done[PaperResult]
) -> list[PaperResult]:
    """Make the cells of a table, then those of the arms that depend on the first results.

    Cells are made seed after seed, so that an early look sees every arm.
    """

    def made(arms: Sequence[PaperArm], before: int) -> list[PaperResult]:
        cells = (Cell(arm, seed, fold) for seed in range(seeds) for arm in arms for fold in range(scene.folds))
        return make_cells(store, cells, lambda cell: make_cell(store, scene, cell, make), done, before)

    first = made(table.arms, 0)
    return first + made(table.then(judged(first)), len(first))


def judged(results: Sequence[PaperResult]) -> Mapping[str, tuple[float, float]]:
    """Return mean PSNR [dB] over the runs, and mean K, of each arm, by the seeds that have a score in every fold."""
    rows = whole(score_table(results))
    compared = set(zip(rows["arm"], rows["seed"], strict=True))
    scored: dict[str, list[PaperResult]] = {}
    for result in results:
        if (result.arm.name, result.seed) in compared:
            scored.setdefault(result.arm.name, []).append(result)
    return {
        arm: (
            float(np.mean([r.views["psnr"].mean() for r in rows])),
            float(np.mean([r.metric("grouping", "k") or 0.0 for r in rows])),
        )
        for arm, rows in scored.items()
    }
