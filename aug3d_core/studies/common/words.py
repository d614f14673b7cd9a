"""What a user picks by words of its name."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from aug3d_core.run.errors import UsageError, shown


def picked(what: str, names: Collection[str], only: Sequence[str]) -> set[str]:
    """Return the names in which some words begin as one of `only` does, all where it is empty.

    Raises UsageError for words that begin none; `what` is what the names are of.
    """
    if not only:
        return set(names)
    found = {words: {name for name in names if words and f" {words.lower()}" in f" {name.lower()}"} for words in only}
    for words, having in found.items():
        if not having:
            raise UsageError(f"there is no {what} {shown(words)}", f"choose from: {'; '.join(names)}")
    return set.union(*found.values())
