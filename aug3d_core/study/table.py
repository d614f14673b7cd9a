"""A row per arm: what it reached, how far that is from the arm it is compared with, what it cost, and what went wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from aug3d_core.nerf.summary import CHEAP
from aug3d_core.study.arm import Arm
from aug3d_core.study.cell import Result
from aug3d_core.study.scores import psnr_by_seed
from aug3d_core.study.statistics import Difference, difference


@dataclass(frozen=True)
class Row:
    """An arm over all its runs; figures are None where no run has a score.

    best, low, average: PSNR (dB) over test photographs and seeds. against: its difference to the arm it is compared with.
    failed: runs without a score, or whose network learned nothing (their scores count all the same).
    seconds, cpu_seconds: of training and testing one run, in the mean. k: members of a group. virtual_views: in the data set.
    """

    arm: Arm
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
        """The arm's name, with the K that was found where it was left open."""
        return self.arm.key + (f" ({self.k})" if "auto" in self.arm.labels.values() and self.k else "")

    def label(self, column: str) -> str:
        """Return what the arm says in a column, with the K that was found where it was left open."""
        said = self.arm.labels.get(column, "")
        return f"auto ({self.k})" if said == "auto" and self.k else said


def rows(results: Sequence[Result], table: pd.DataFrame) -> list[Row]:
    """Return the rows of all arms that were tried, in order."""
    by_arm: dict[str, list[Result]] = {}
    for result in results:
        by_arm.setdefault(result.cell.arm.key, []).append(result)
    return [_row(tried, table) for tried in by_arm.values()]


def _row(tried: Sequence[Result], table: pd.DataFrame) -> Row:
    arm = tried[0].cell.arm
    scored = [result for result in tried if not result.failure]
    mine = table[table["arm"] == arm.key]
    psnr = np.asarray(mine["psnr"], float)
    told = len(psnr) > 0
    return Row(
        arm=arm,
        runs=len(tried),
        failed=sum(result.failed for result in tried),
        k=_whole(tried, "grouping", "k"),
        groups=_whole(tried, "grouping", "groups"),
        virtual_views=_whole(scored, "dataset", "rendered"),
        best=float(psnr.max()) if told else None,
        low=float(psnr.min()) if told else None,
        average=float(psnr.mean()) if told else None,
        ssim=float(np.mean(np.asarray(mine["ssim"], float))) if told else None,
        seeds=tuple(psnr_by_seed(table, arm.key).to_numpy(float).mean(axis=1).tolist()) if told else (),
        against=difference(table, arm.key, arm.against) if arm.against != arm.key else None,
        seconds=float(np.mean([result.seconds for result in scored])) if scored else None,
        cpu_seconds=float(np.mean([result.cpu_seconds for result in scored])) if scored else None,
        notes=_notes(tried),
    )


def _notes(tried: Sequence[Result]) -> tuple[str, ...]:
    failures = [f"{_runs(result)} failed: {result.failure}" for result in tried if result.failure]
    if len(failures) == len(tried) and len({result.failure for result in tried}) == 1:
        failures = [f"failed: {tried[0].failure}"]
    return tuple(dict.fromkeys([*failures, *(note for result in tried for note in result.notes)]))


def _runs(result: Result) -> str:
    return f"seed {result.cell.seed}" + (f" of fold {result.cell.fold}" if result.cell.fold else "")


def _whole(results: Sequence[Result], stage: str, name: str) -> int | None:
    found = [value for result in results if (value := result.metric(stage, name)) is not None]
    return round(float(np.mean(found))) if found else None


def cheap_answers(table: pd.DataFrame) -> Mapping[int, Mapping[str, float]]:
    """Return the mean PSNR (dB) of each cheap answer on the same test, by the number of input views."""
    return {
        int(str(inputs)): {name: float(np.mean(np.asarray(cells[f"{name}_psnr"], float))) for name in CHEAP}
        for inputs, cells in table.groupby("input_views")
    }
