"""The rows of a table by one of its columns, sorted once: to look for each key through all rows takes keys times as long."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int


class Rows:
    """The rows that have each key; keys are whole numbers from 0 on."""

    def __init__(self, key_of_row: Int[np.ndarray, " t"], keys: int) -> None:
        """`keys` is how many keys there may be, also such that no row has."""
        self._order = np.argsort(key_of_row, kind="stable")
        self._first = np.searchsorted(key_of_row[self._order], np.arange(keys + 1))

    def having(self, keys: Int[np.ndarray, " k"]) -> Int[np.ndarray, " s"]:
        """Return the rows that have one of these keys, in ascending order; no key may be named twice."""
        count = self._first[keys + 1] - self._first[keys]
        skipped = np.repeat(self._first[keys] - (np.cumsum(count) - count), count)
        return np.sort(self._order[np.arange(len(skipped)) + skipped])
