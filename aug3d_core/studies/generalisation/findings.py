"""Scores of each scene in each way, with paired leads: over the cheap answers, and of one way over another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from aug3d_core.heads.config import title_of
from aug3d_core.store.usage import named
from aug3d_core.studies.common.statistics import interval
from aug3d_core.studies.generalisation.cells import WAYS, Generalised

CHEAP = ("ground_homography", "plane_sweep", "mesh_render", "guided_blend")
FROM_INPUTS = CHEAP[:2]  # what a model from the inputs alone is held against


@dataclass(frozen=True)
class Lead:
    """A paired difference [dB] over test photographs and seeds; low, high: its 95 % interval, None for too few of them."""

    mean: float
    low: float | None
    high: float | None

    def text(self) -> str:
        """Say it in a table."""
        return f"{self.mean:+.2f}" if self.low is None else f"{self.mean:+.2f} [{self.low:.2f}, {self.high:.2f}]"


@dataclass(frozen=True)
class Row:
    """A scene in one way with one head: means over photographs and seeds. over: leads over the cheap answers.

    foreseen_db: of a model that never saw the scene, its lead [dB] over the better cheap answer on photographs that the
    preview predicts from the others, the least of all seeds. warned: whether the preview warned, with every seed.
    """

    scene: str
    way: str
    head: str
    views: int
    psnr: float
    alone_psnr: float
    ssim: float
    flip: float
    cpu_seconds: float
    over: dict[str, Lead]
    foreseen_db: float | None = None
    warned: bool | None = None

    @property
    def silent(self) -> bool:
        """Whether the model is no better than a cheap answer from the same inputs, and nothing said so."""
        return self.warned is False and min(self.over[cheap].mean for cheap in FROM_INPUTS) <= 0


@dataclass(frozen=True)
class GeneralisationFindings:
    """What the study found. against: of each scene and head, the tuned model and that of other places over the one alone.

    Ways are compared where they share a seed.
    """

    collection: str
    seeds: int
    machine: str
    results: Sequence[Generalised]
    rows: Sequence[Row]
    against: dict[str, Lead]

    @property
    def failed(self) -> list[Generalised]:
        """The cells without figures."""
        return [result for result in self.results if result.failure]

    @property
    def silent(self) -> list[Row]:
        """The models that failed where they were told to be good."""
        return [row for row in self.rows if row.silent]

    def as_json(self) -> dict[str, Any]:
        """Return `study.json`."""
        return {
            "study": "generalisation",
            "collection": self.collection,
            "seeds": self.seeds,
            "machine": self.machine,
            "rows": [{**vars(row), "over": {name: vars(lead) for name, lead in row.over.items()}} for row in self.rows],
            "silent": [f"{row.scene}, {title_of(row.head)}" for row in self.silent],
            "against": {name: vars(lead) for name, lead in self.against.items()},
            "cells": [{"name": result.cell.name, **result.as_json()} for result in self.results],
            "objects": [list(item) for item in named(record for result in self.results for record in result.used)],
        }


def findings(collection: str, seeds: int, machine: str, results: Sequence[Generalised]) -> GeneralisationFindings:
    """Judge the cells."""
    groups: dict[tuple[str, str, str], list[Generalised]] = {}
    for result in results:
        if result.views is not None:
            arm = result.arm
            groups.setdefault((arm.scene, arm.way, arm.head), []).append(result)
    rows = [_row(*key, cells) for key, cells in groups.items()]
    against = {}
    for (scene, way, head), cells in groups.items():
        alone = groups.get((scene, "alone", head))
        if way != "alone" and alone:
            for what in ("psnr", "alone"):
                mine, its = _by_seed(cells, what), _by_seed(alone, what)
                apart = [mine[seed] - its[seed] for seed in sorted(mine.keys() & its.keys())]
                words = "about the scaffold" if what == "psnr" else "from the inputs alone"
                if apart:
                    against[f"{scene}: {title_of(head)} {way} over alone, {words}"] = _lead(np.stack(apart))
    return GeneralisationFindings(collection, seeds, machine, results, rows, against)


def _row(scene: str, way: str, head: str, cells: list[Generalised]) -> Row:
    tables = [cell.views for cell in cells if cell.views is not None]
    over = {}
    for cheap in CHEAP:
        own = _scores(cells, "alone" if cheap in FROM_INPUTS else "psnr")
        over[cheap] = _lead(own - np.stack([np.asarray(table[f"{cheap}_psnr"], float) for table in tables]))
    return Row(
        scene,
        way,
        head,
        len(tables[0]),
        float(_scores(cells, "psnr").mean()),
        float(_scores(cells, "alone").mean()),
        float(np.mean([table["ssim"].mean() for table in tables])),
        float(np.mean([table["flip"].mean() for table in tables])),
        float(np.mean([cell.cpu_seconds for cell in cells])),
        over,
        *_foreseen(cells),
    )


def _foreseen(cells: Sequence[Generalised]) -> tuple[float | None, bool | None]:
    previews = [cell.preview for cell in cells if cell.preview is not None]
    if not previews:
        return None, None
    leads = [float(record.metrics["over_best_cheap_db"] or 0) for record in previews]
    return min(leads), all(record.state == "degraded" for record in previews)


def _scores(cells: Sequence[Generalised], what: str) -> np.ndarray:
    """Return the scores (seeds, photographs): of the answer, or of that from the inputs alone."""
    return np.stack([*_by_seed(cells, what).values()])


def _by_seed(cells: Sequence[Generalised], what: str) -> dict[int, np.ndarray]:
    """Return the scores of each seed (photographs): of the answer, or of that from the inputs alone."""
    tables = {cell.seed: cell.views for cell in cells if cell.views is not None}
    free = what == "alone" and all("inputs_alone_psnr" in table for table in tables.values())
    return {seed: np.asarray(table["inputs_alone_psnr" if free else "psnr"], float) for seed, table in tables.items()}


def _lead(values: np.ndarray) -> Lead:
    ends = interval(
        np.repeat(values, 2, axis=0) if len(values) == 1 else values
    )  # one seed: photographs alone are drawn
    return Lead(float(values.mean()), *(ends or (None, None)))


def score_table(found: GeneralisationFindings) -> pd.DataFrame:
    """Return every score of every cell, for programs."""
    parts = [
        result.views.assign(scene=result.arm.scene, way=result.arm.way, head=result.arm.head, seed=result.seed)
        for result in found.results
        if result.views is not None
    ]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame({"scene": [], "way": [], "head": []})


def order(row: Row) -> tuple[str, str, int]:
    """Sort rows: scene, head, way."""
    return row.scene, row.head, WAYS.index(row.way)  # type: ignore[arg-type]
