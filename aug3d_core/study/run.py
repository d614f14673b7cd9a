"""Every cell of a study. What a killed study made is in the store, so the same call goes on where it was."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from aug3d_core.store.store import Store
from aug3d_core.study.arm import Arm, Study
from aug3d_core.study.cell import Cell, Result, Say, make_cell
from aug3d_core.study.scene import FinishedScene

Done = Callable[[Result, int, int], None]  # a cell's result, how many are done, of how many


def run_study(store: Store, study: Study, scene: FinishedScene, seeds: int, say: Say, done: Done) -> list[Result]:
    """Make the cells of a study: seed after seed, so that an early look sees every arm; then those that the first call for."""
    results: list[Result] = []
    _make_all(store, scene, study.arms, seeds, results, say, done)
    _make_all(store, scene, study.then(judged(results)), seeds, results, say, done)
    return results


def judged(results: Sequence[Result]) -> Mapping[str, tuple[float, float]]:
    """Return mean PSNR (dB) over the runs, and mean K, of each arm that has a run with a score."""
    scored: dict[str, list[Result]] = {}
    for result in results:
        if not result.failure:
            scored.setdefault(result.cell.arm.key, []).append(result)
    return {
        arm: (
            float(np.mean([r.views["psnr"].mean() for r in rows])),
            float(np.mean([r.metric("grouping", "k") or 0.0 for r in rows])),
        )
        for arm, rows in scored.items()
    }


def _make_all(
    store: Store,
    scene: FinishedScene,
    arms: Sequence[Arm],
    seeds: int,
    results: list[Result],
    say: Say,
    done: Done,
) -> None:
    cells = [Cell(arm, seed, fold) for seed in range(seeds) for arm in arms for fold in range(scene.folds)]
    before = len(results)
    for cell in cells:
        results.append(make_cell(store, scene, cell, say))
        done(results[-1], len(results), before + len(cells))
