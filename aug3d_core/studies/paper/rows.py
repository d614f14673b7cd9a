"""A row per arm: its scores, the difference to the arm that it is compared with, its cost, and its failures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from aug3d_core.judging.summary import CHEAP
from aug3d_core.studies.paper.arm import PaperArm
from aug3d_core.studies.paper.cell import PaperResult
from aug3d_core.studies.paper.orderings import Difference, difference
from aug3d_core.studies.paper.scores import psnr_by_seed, whole


@dataclass(frozen=True)
class ArmRow:
    """An arm over all its runs; figures are None where no run has a score, scores where no seed has one in every fold.

    best, low, average: PSNR [dB] over test photographs and those seeds.
    against: difference to the arm that it is compared with.
    failed: runs without a score, or whose network learned nothing (their scores are included).
    seconds, cpu_seconds: mean over runs, of training and test. k: members of a group. virtual_views: in the data set.
    """

    arm: PaperArm
    runs: int
    failed: int
    k: int | None
    groups: int | None
    virtual_views: int | None
    best: float | None
    low: float | None
    average: float | None
    ssim: float | None
    seeds: tuple[float, ...]  # mean PSNR of each seed
    against: Difference | None
    seconds: float | None
    cpu_seconds: float | None
    notes: tuple[str, ...]

    @property
    def name(self) -> str:
        """The arm's name, with the K that was chosen if it was left open."""
        return self.arm.name + (f" ({self.k})" if "auto" in self.arm.labels.values() and self.k else "")

    def label(self, column: str) -> str:
        """Return the arm's cell in a column, with the K that was chosen if it was left open."""
        said = self.arm.labels.get(column, "")
        return f"auto ({self.k})" if said == "auto" and self.k else said


def rows(results: Sequence[PaperResult], table: pd.DataFrame) -> list[ArmRow]:
    """Return the rows of all arms that were tried, in order."""
    by_arm: dict[str, list[PaperResult]] = {}
    for result in results:
        by_arm.setdefault(result.arm.name, []).append(result)
    return [_row(tried, table) for tried in by_arm.values()]


def _row(tried: Sequence[PaperResult], table: pd.DataFrame) -> ArmRow:
    arm = tried[0].arm
    scored = [result for result in tried if not result.failure]
    compared = whole(table)
    mine = compared[compared["arm"] == arm.name]
    psnr = np.asarray(mine["psnr"], float)
    scores = len(psnr) > 0
    return ArmRow(
        arm=arm,
        runs=len(tried),
        failed=sum(result.failed for result in tried),
        k=_whole(tried, "grouping", "k"),
        groups=_whole(tried, "grouping", "groups"),
        virtual_views=_whole(scored, "dataset", "rendered"),
        best=float(psnr.max()) if scores else None,
        low=float(psnr.min()) if scores else None,
        average=float(psnr.mean()) if scores else None,
        ssim=float(np.mean(np.asarray(mine["ssim"], float))) if scores else None,
        seeds=tuple(psnr_by_seed(table, arm.name).to_numpy(float).mean(axis=1).tolist()) if scores else (),
        against=difference(table, arm.name, arm.against) if arm.against != arm.name else None,
        seconds=float(np.mean([result.seconds for result in scored])) if scored else None,
        cpu_seconds=float(np.mean([result.cpu_seconds for result in scored])) if scored else None,
        notes=_notes(tried),
    )


def _notes(tried: Sequence[PaperResult]) -> tuple[str, ...]:
    failures = [f"{_runs(result)} failed: {result.failure}" for result in tried if result.failure]
    if len(failures) == len(tried) and len({result.failure for result in tried}) == 1:
        failures = [f"failed: {tried[0].failure}"]
    return tuple(dict.fromkeys([*failures, *(note for result in tried for note in result.notes)]))


def _runs(result: PaperResult) -> str:
    return f"seed {result.seed}" + (f" of fold {result.cell.fold}" if result.cell.fold else "")


def _whole(results: Sequence[PaperResult], stage: str, name: str) -> int | None:
    found = [value for result in results if (value := result.metric(stage, name)) is not None]
    return round(float(np.mean(found))) if found else None


def cheap_answers(table: pd.DataFrame) -> Mapping[int, Mapping[str, float]]:
    """Return the mean PSNR [dB] of each cheap answer on the whole test, by the number of input views."""
    return {
        int(str(inputs)): {name: float(np.mean(np.asarray(cells[f"{name}_psnr"], float))) for name in CHEAP}
        for inputs, cells in whole(table).groupby("input_views")
    }
