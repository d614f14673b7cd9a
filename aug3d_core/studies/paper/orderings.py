"""Differences between arms, and what they say about an ordering."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd

from aug3d_core.studies.common.statistics import interval
from aug3d_core.studies.paper.arm import Ordering
from aug3d_core.studies.paper.scores import paired

Verdict = Literal["holds", "does not hold", "not decided"]


@dataclass(frozen=True)
class Difference:
    """How far one arm is above another: mean and 95 % interval [dB]; None where they share no run with a score."""

    first: str
    second: str
    mean: float | None
    interval: tuple[float, float] | None

    @property
    def verdict(self) -> Verdict:
        """Say whether the first is above the second."""
        if self.interval is None or not np.isfinite(self.interval).all() or self.interval[0] <= 0 <= self.interval[1]:
            return "not decided"
        return "holds" if self.interval[0] > 0 else "does not hold"


@dataclass(frozen=True)
class JudgedOrdering:
    """An ordering, the difference of each of its pairs, and the verdict."""

    ordering: Ordering
    differences: tuple[Difference, ...]

    @property
    def verdict(self) -> Verdict:
        """It holds if it holds for every pair. One reversed pair refutes it."""
        found = {difference.verdict for difference in self.differences}
        if "does not hold" in found:
            return "does not hold"
        return "holds" if found == {"holds"} else "not decided"


def judge_orderings(table: pd.DataFrame, orderings: Sequence[Ordering]) -> list[JudgedOrdering]:
    """Judge each ordering by the scores."""
    return [JudgedOrdering(o, tuple(difference(table, first, second) for first, second in o.pairs)) for o in orderings]


def difference(table: pd.DataFrame, first: str, second: str) -> Difference:
    """Return how far the first arm is above the second."""
    values = paired(table, first, second)
    if not values.size:
        return Difference(first, second, None, None)
    return Difference(first, second, float(values.mean()), interval(values))
