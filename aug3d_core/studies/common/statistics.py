"""The interval of a paired difference.

All arms are judged on the same photographs with the same seeds. They are compared by the difference at each photograph and
seed, so that the difficulty of a photograph cancels out. Seeds and photographs are both samples, and both are resampled:
the pigeonhole bootstrap of two crossed factors (Owen 2007, The pigeonhole bootstrap, equation 3), which errs on the wide
side. With few photographs a percentile interval is too narrow; it is widened to the width of a t interval (Hesterberg 2015,
What teachers should know about the bootstrap, section 4.4). Neighbouring photographs are alike: what is drawn are runs of
them.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy import stats

from aug3d_core.judging.summary import runs_of_neighbours

_RESAMPLES, _SEED = 10_000, 0
_LEVEL = 0.95


def interval(values: Float[np.ndarray, "s p"]) -> tuple[float, float] | None:
    """Return the 95 % interval of the mean over seeds and photographs; None for one seed or one photograph.

    The photographs stand in the order of the flight.
    """
    if min(values.shape) < 2:
        return None
    runs = runs_of_neighbours(values)
    seeds, photos = runs.shape
    rng = np.random.default_rng(_SEED)
    by_seed = rng.multinomial(seeds, np.full(seeds, 1 / seeds), _RESAMPLES) / seeds
    by_photo = rng.multinomial(photos, np.full(photos, 1 / photos), _RESAMPLES) / photos
    means = np.einsum("rs,sp,rp->r", by_seed, runs, by_photo)
    wide = np.sqrt(photos / (photos - 1)) * stats.t.ppf((1 + _LEVEL) / 2, photos - 1)
    tail = float(stats.norm.cdf(-wide))
    low, high = np.quantile(means, [tail, 1 - tail])
    return float(low), float(high)
