"""Pictures of views that are read or made when they are asked for: a scene of any size needs the memory of a few."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import DTypeLike


class ByView(ABC):
    """An array of pictures, of which each is got by its number. It is indexed as a numpy array is, by views first."""

    def __init__(self, shape: tuple[int, ...], dtype: DTypeLike) -> None:
        self.shape = shape
        self.dtype: np.dtype = np.dtype(dtype)

    @abstractmethod
    def _view(self, view: int) -> np.ndarray:
        """Return one picture."""

    def __len__(self) -> int:
        return self.shape[0]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """Get everything."""
        return np.asarray(self[:], dtype)

    def __getitem__(self, key: Any) -> Any:
        """Return what numpy would: views by a number, numbers or a slice, and then what is asked of each."""
        views, *rest = key if isinstance(key, tuple) else (key,)
        numbers = np.arange(len(self))[views]
        if np.ndim(numbers) == 0:
            return self._view(int(numbers))[tuple(rest)]
        if any(not isinstance(part, slice) for part in rest):  # arrays of pixels, one for each view named
            own, place = np.unique(numbers, return_inverse=True)
            return np.stack([self._view(int(view)) for view in own])[(place, *rest)]
        if not numbers.size:
            return np.zeros((*numbers.shape, *np.zeros(self.shape[1:], bool)[tuple(rest)].shape), self.dtype)
        values = np.stack([self._view(int(view))[tuple(rest)] for view in numbers.ravel()])
        return values.reshape(*numbers.shape, *values.shape[1:])


class OnDemand(ByView):
    """Pictures that a function makes of their number."""

    def __init__(self, count: int, size: tuple[int, ...], dtype: DTypeLike, make: Callable[[int], np.ndarray]) -> None:
        super().__init__((count, *size), dtype)
        self._make = make

    def _view(self, view: int) -> np.ndarray:
        return np.asarray(self._make(view), self.dtype)


# A type checker takes the pictures of a scene for an array; so it cannot be told what these return


def joined(first: Any, second: Any) -> Any:
    """Return the pictures of one array followed by those of another."""
    count = len(first)
    return OnDemand(
        count + len(second),
        first.shape[1:],
        first.dtype,
        lambda view: first[view] if view < count else second[view - count],
    )


def changed(pictures: Any, others: Mapping[int, np.ndarray]) -> Any:
    """Return the pictures with others in the place of some."""
    return OnDemand(
        len(pictures),
        pictures.shape[1:],
        pictures.dtype,
        lambda view: others[view] if view in others else pictures[view],
    )
