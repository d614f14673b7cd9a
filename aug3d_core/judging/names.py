"""Names of answers, for people. Light: every command shows them."""

from __future__ import annotations


def called(cheap: str) -> str:
    """Return how people are told of a cheap answer: one has the name of a head, and is not it."""
    return "sweep without learning" if cheap == "plane_sweep" else cheap.replace("_", " ")
