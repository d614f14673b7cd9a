"""Spread of errors of which some are wild."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

_STD_BY_MEDIAN = 1.4826  # of normal errors: the standard deviation over the median absolute value, 1 / 0.6745


def spread(off: Float[np.ndarray, " n"]) -> float:
    """Return the standard deviation of normal errors whose median absolute value is that of these; NaN of none."""
    return _STD_BY_MEDIAN * float(np.median(np.abs(off)))
