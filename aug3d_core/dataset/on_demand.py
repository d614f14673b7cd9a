"""Pictures of views that are made when they are asked for: a scene of any size is packed in the memory of one shard."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import DTypeLike


class OnDemand:
    """An array of pictures of which each is computed from its number. It is indexed by a view, views or a slice of them."""

    def __init__(self, count: int, size: tuple[int, ...], dtype: DTypeLike, make: Callable[[int], np.ndarray]) -> None:
        self.shape: tuple[int, ...] = (count, *size)
        self.dtype: np.dtype = np.dtype(dtype)
        self._make = make

    def __len__(self) -> int:
        return self.shape[0]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """Make everything."""
        return np.asarray(self[:], dtype)

    def __getitem__(self, views: Any) -> np.ndarray:
        """Return what numpy would."""
        numbers = np.arange(len(self))[views]
        if np.ndim(numbers) == 0:
            return np.asarray(self._make(int(numbers)), self.dtype)
        found = np.empty((len(numbers), *self.shape[1:]), self.dtype)
        for row, view in enumerate(numbers):
            found[row] = self._make(int(view))
        return found


def joined(first: OnDemand, second: OnDemand) -> Any:  # a type checker takes a scene's pictures for an array
    """Return the pictures of one array followed by those of another, as an OnDemand."""
    count = len(first)
    return OnDemand(
        count + len(second),
        first.shape[1:],
        first.dtype,
        lambda view: first[view] if view < count else second[view - count],
    )
