"""Positions that are measured wrongly, the same for exact worlds and for photographs."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

WILD_M = 100.0


def scattered(at_m: Float[np.ndarray, "n 3"], sigma_m: float, rng: np.random.Generator) -> Float[np.ndarray, "n 3"]:
    """Return positions with noise on each axis."""
    return at_m + rng.normal(0, sigma_m, at_m.shape)


def thrown(at_m: Float[np.ndarray, "n 3"], share: float, rng: np.random.Generator) -> Float[np.ndarray, "n 3"]:
    """Return positions of which a share lies 100 m to the side, each in a direction of its own."""
    wrong = rng.permutation(len(at_m)) < round(share * len(at_m))
    way = rng.uniform(0, 2 * np.pi, len(at_m))
    off_m = WILD_M * np.column_stack([np.cos(way), np.sin(way), np.zeros(len(at_m))])
    return at_m + wrong[:, None] * off_m
