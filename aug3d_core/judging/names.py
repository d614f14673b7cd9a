"""Names of answers, for people. Light: every command shows them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any


def called(cheap: str) -> str:
    """Return how people are told of a cheap answer: one has the name of a head, and is not it."""
    return "sweep without learning" if cheap == "plane_sweep" else cheap.replace("_", " ")


def ends_of(figures: Mapping[str, Any], name: str) -> tuple[float, float] | None:
    """Return the interval of a figure; None where one test photograph gave none."""
    low, high = (figures[f"{name}_ci_{end}"] for end in ("low", "high"))
    return None if low is None or high is None else (low, high)


def interval_words(ends: Sequence[float] | None) -> str:
    """Return an interval as it stands behind its figure, "" if there is none."""
    return "" if ends is None else f"  [{ends[0]:.2f}, {ends[1]:.2f}]"
