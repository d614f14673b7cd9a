"""How fast training learns at each step, and when it has learned enough.

The rate warms up and falls along half a cosine. Once steps at the present rate no longer pay, training does not stop
there: much of what it gains comes at low rates. It takes the rest of the cosine in a short tail, and stops at its end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from aug3d_core.training.config import TrainingConfig

PROBES = 60  # measurements on fixed rays in a whole training; each costs about as much as one step
ENOUGH_PROBES = 10  # before these, nothing is said of a trend
TAIL_SHARE = 0.25  # length of the tail as a share of the steps before it


class Probe(NamedTuple):
    """The error on fixed rays of training groups."""

    step: int  # steps done
    psnr: float  # dB


def rate(config: TrainingConfig, step: int, tail_from: int | None = None, restarts: int = 0) -> float:
    """Return the learning rate of a step; each restart divides it by three."""
    peak = config.learning_rate / 3**restarts
    if step < config.warmup_steps:
        return peak * (step + 1) / config.warmup_steps
    done = _share_done(config, step)
    if tail_from is not None and step >= tail_from:
        start, end = _share_done(config, tail_from), last_step(config, tail_from)
        done = start + (1 - start) * (step - tail_from) / max(end - tail_from, 1)
    last = config.final_rate_share
    return peak * (last + (1 - last) * (1 + math.cos(math.pi * done)) / 2)


def _share_done(config: TrainingConfig, step: int) -> float:
    return max(step - config.warmup_steps, 0) / max(config.steps - config.warmup_steps, 1)


def last_step(config: TrainingConfig, tail_from: int | None) -> int:
    """Return the number of steps after which training ends."""
    if tail_from is None:
        return config.steps
    return min(config.steps, tail_from + math.ceil(TAIL_SHARE * tail_from))


def probe_due(config: TrainingConfig, step: int) -> bool:
    """Tell whether fixed rays are to be measured after a step."""
    return config.least_gain_db > 0 and step % max(config.steps // PROBES, 1) == 0


def enough(config: TrainingConfig, probes: Sequence[Probe]) -> bool:
    """Tell whether the last half of the steps surely gained less than it is worth.

    Their two halves are compared. Errors on fixed rays still jump from step to step, so the gain is believed to be small
    only where it is so by two of its standard errors.
    """
    window = [probe.psnr for probe in probes if probe.step > probes[-1].step / 2]
    if len(window) < ENOUGH_PROBES or probes[-1].step < 2 * config.warmup_steps:
        return False
    early, late = np.array_split(np.array(window), 2)
    noise = math.sqrt(early.var(ddof=1) / len(early) + late.var(ddof=1) / len(late))
    return float(late.mean() - early.mean()) + 2 * noise < config.least_gain_db
