"""Is training alive? Decided from what every step measured alone, so that it is tested without training anything.

An honest start may look dead: a fresh network of the paper shows one grey for hundreds of steps. So nothing is judged
by how good it is, but by what it cannot come back from (a constant colour, density that gets no gradient), or by having
been better before. Beside each bound stands what healthy runs on the town showed: preset tiny for 1,060 steps, and a
network as the paper's (ReLU density, no blend, no slab, rate 1e-4) for its first 200.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from aug3d_core.heads.config import Measures, Symptom

# Steps that trouble lasts before it is believed, and the length of the blocks in which errors are averaged. Whatever
# lasts is seen after one window, a loss of what was learned after at most two: within 500 steps in any case.
WINDOW = 200


class Trouble(NamedTuple):
    """What is wrong, and since when."""

    onset: int  # steps that were done when it began
    seen_at: int  # steps that were done when it was seen
    what: str


def find_trouble(history: Sequence[Measures], symptoms: Mapping[str, Symptom]) -> Trouble | None:
    """Look at the last step and what led to it. symptoms: those of the head, each by the sentence that names it."""
    done, last = len(history), history[-1]
    for name in ("loss", "gradient"):
        if not math.isfinite(last[name]):
            return Trouble(done - 1, done, f"the {name} is {last[name]}")
    for what, shows in {**symptoms, **SYMPTOMS}.items():
        if shows(last) and done >= WINDOW and all(shows(step) for step in history[-WINDOW:]):
            return Trouble(done - WINDOW, done, what)
    return _ruined(history) if done % WINDOW == 0 else None


def worse_than_one_colour(history: Sequence[Measures]) -> bool:
    """Tell whether the last steps were worse than one colour for each group would have been."""
    return _skill(history[-WINDOW:]) <= 0


def _one_colour(step: Measures) -> bool:
    """Healthy: a share never below 0.2. A truth with hardly any spread itself (2 grey levels) says nothing."""
    return step["truth_spread"] > 1e-4 and step["spread"] < 1e-4 * step["truth_spread"]


# What a step shows of a head that gets no gradient any more, whatever it is inside
SYMPTOMS: dict[str, Symptom] = {
    "every pixel is black": lambda step: _one_colour(step) and step["brightness"] < 0.02 < step["truth_brightness"],
    "every pixel has the same colour": _one_colour,
}


def _ruined(history: Sequence[Measures]) -> Trouble | None:
    """Find a block of steps worse than one colour after a clearly better one, or far worse than an untrained network."""
    skills = [_skill(history[i : i + WINDOW]) for i in range(0, len(history), WINDOW)]
    good = [i for i, skill in enumerate(skills) if skill > 0.1 and skill > max(skills) / 2]
    since = good[-1] * WINDOW if good else 0  # it may have begun within the last good block
    if good and skills[-1] <= 0:
        return Trouble(since, len(history), "pixels are worse than one colour, and were better")
    if 1 - skills[-1] > 2 * max(1 - _skill(history[:1]), 1):  # healthy: falls from its first step on
        return Trouble(since, len(history), "pixels are twice as wrong as those of an untrained network")
    return None


def _skill(steps: Sequence[Measures]) -> float:
    """Return the share of the truth's spread that is explained: 1 is perfect, 0 is one colour for each group."""
    error = float(np.mean([step["error"] for step in steps]))
    return 1 - error / max(float(np.mean([step["truth_spread"] for step in steps])), 1e-12)
