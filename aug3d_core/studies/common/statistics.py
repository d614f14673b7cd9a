"""The interval of a paired difference.

All arms are judged on the same photographs with the same seeds. They are compared by the difference at each photograph and
seed, so that the difficulty of a photograph cancels out. Seeds and photographs are both samples: an analysis of variance of
two crossed random factors tells how much of the mean's variance is of each (Searle, Casella, McCulloch 1992, Variance
Components, section 4.3), and the fewer of what it is of, the wider the t interval (Satterthwaite 1946, An approximate
distribution of estimates of variance components). Neighbouring photographs are alike: runs of them count as one.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy import stats

from aug3d_core.judging.summary import runs_of_neighbours

_LEVEL = 0.95


def interval(values: Float[np.ndarray, "s p"]) -> tuple[float, float] | None:
    """Return the 95 % interval of the mean over seeds and photographs; None for one seed or one photograph.

    The photographs stand in the order of the flight.
    """
    if min(values.shape) < 2:
        return None
    runs = runs_of_neighbours(values)
    mean, by_seed, by_run = runs.mean(), runs.mean(axis=1), runs.mean(axis=0)
    rest = runs - by_seed[:, None] - by_run + mean
    free = np.array([runs.shape[0] - 1, runs.shape[1] - 1])  # degrees of freedom: of seeds, of runs
    # Mean squares: each tells of its own factor and, once more, of what is of neither
    squares = np.array([((by_seed - mean) ** 2).mean(), ((by_run - mean) ** 2).mean()]) * runs.size / free
    neither = (rest**2).sum() / free.prod()
    variance = squares.sum() - neither
    if variance > squares.max():
        freedom = 1 / (((squares / variance) ** 2 / free).sum() + (neither / variance) ** 2 / free.prod())
    else:  # by chance: it is no less than that of either
        variance, freedom = squares.max(), free[squares.argmax()]
    half = stats.t.ppf((1 + _LEVEL) / 2, freedom) * np.sqrt(variance / runs.size)
    return float(mean - half), float(mean + half)
