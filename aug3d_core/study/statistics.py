"""Intervals of paired differences, and what they say of an ordering.

Every arm is judged on the same photographs with the same seeds, so arms are compared by the difference at each photograph
and seed: how hard a photograph is falls out. Both are a sample of what could have been, and both are drawn anew: the
pigeonhole bootstrap of two crossed factors (Owen 2007, The pigeonhole bootstrap, equation 3), which errs on the wide
side. With few photographs a percentile interval is too narrow; it is widened to a t interval's width (Hesterberg 2015,
What teachers should know about the bootstrap, section 4.4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd
from jaxtyping import Float
from scipy import stats

from aug3d_core.study.arm import Ordering
from aug3d_core.study.scores import paired

Verdict = Literal["holds", "does not hold", "not decided"]
_RESAMPLES, _SEED = 10_000, 0
_LEVEL = 0.95


@dataclass(frozen=True)
class Difference:
    """How far one arm is above another: mean and 95 % interval (dB), None where they share no run with a score."""

    first: str
    second: str
    mean: float | None
    interval: tuple[float, float] | None

    @property
    def verdict(self) -> Verdict:
        """Say whether the first is above the second."""
        if self.interval is None or self.interval[0] <= 0 <= self.interval[1]:
            return "not decided"
        return "holds" if self.interval[0] > 0 else "does not hold"


@dataclass(frozen=True)
class Tested:
    """An ordering, the difference of each of its pairs, and what they say together."""

    ordering: Ordering
    differences: tuple[Difference, ...]

    @property
    def verdict(self) -> Verdict:
        """Say that it holds only if it does for every pair; one pair that is the other way round is enough against it."""
        found = {difference.verdict for difference in self.differences}
        if "does not hold" in found:
            return "does not hold"
        return "holds" if found == {"holds"} else "not decided"


def test_orderings(table: pd.DataFrame, orderings: Sequence[Ordering]) -> list[Tested]:
    """Return what the scores say of each ordering."""
    return [Tested(o, tuple(difference(table, first, second) for first, second in o.pairs)) for o in orderings]


def difference(table: pd.DataFrame, first: str, second: str) -> Difference:
    """Return how far the first arm is above the second."""
    values = paired(table, first, second)
    if not values.size:
        return Difference(first, second, None, None)
    return Difference(first, second, float(values.mean()), interval(values))


def interval(values: Float[np.ndarray, "s p"]) -> tuple[float, float] | None:
    """Return the 95 % interval of the mean over seeds and photographs; None for one of either: no chance shows in one."""
    seeds, photos = values.shape
    if min(seeds, photos) < 2:
        return None
    rng = np.random.default_rng(_SEED)
    by_seed = rng.multinomial(seeds, np.full(seeds, 1 / seeds), _RESAMPLES) / seeds
    by_photo = rng.multinomial(photos, np.full(photos, 1 / photos), _RESAMPLES) / photos
    means = np.einsum("rs,sp,rp->r", by_seed, values, by_photo)
    wide = np.sqrt(photos / (photos - 1)) * stats.t.ppf((1 + _LEVEL) / 2, photos - 1)
    tail = float(stats.norm.cdf(-wide))
    low, high = np.quantile(means, [tail, 1 - tail])
    return float(low), float(high)
