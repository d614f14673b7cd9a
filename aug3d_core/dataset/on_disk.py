"""Pictures of a packed scene that stay on disk until they are asked for: training sees many scenes in bounded memory."""

from __future__ import annotations

import itertools
import threading
from collections import OrderedDict
from collections.abc import Iterator
from typing import Any

import numpy as np

from aug3d_core.run.errors import InputError

_NUMBERS = itertools.count()


USUAL_BYTES = 768 * 2**20  # some 2,000 views of 256 x 192 px


class Cache:
    """Decoded views of any number of arrays, up to a limit of memory; what was asked for longest ago goes first."""

    def __init__(self, limit_bytes: int = USUAL_BYTES) -> None:
        self.limit_bytes = limit_bytes
        self.held_bytes = 0
        self._held: OrderedDict[tuple[int, int], np.ndarray] = OrderedDict()  # by array and view
        self._lock = threading.Lock()

    def get(self, array: int, view: int) -> np.ndarray | None:
        """Return a view that is held."""
        with self._lock:
            found = self._held.get((array, view))
            if found is not None:
                self._held.move_to_end((array, view))
            return found

    def put(self, array: int, view: int, values: np.ndarray) -> None:
        """Hold a view, and let go of others where there is no room."""
        with self._lock:
            if (array, view) in self._held:
                return
            self._held[array, view] = values
            self.held_bytes += values.nbytes
            while self.held_bytes > self.limit_bytes and len(self._held) > 1:
                self.held_bytes -= self._held.popitem(last=False)[1].nbytes


class OnDisk:
    """A Zarr array with one chunk for each view. It is indexed as a numpy array is, by views first."""

    def __init__(self, array: Any, cache: Cache) -> None:  # zarr itself is heavy to import, and reads of itself
        self._array, self._cache, self._number = array, cache, next(_NUMBERS)
        self.shape: tuple[int, ...] = array.shape
        self.dtype: np.dtype = np.dtype(array.dtype)

    def __len__(self) -> int:
        return self.shape[0]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """Read everything."""
        return np.asarray(self._array[...], dtype)

    def __getitem__(self, key: Any) -> Any:
        """Return what numpy would: views by a number, numbers or a slice, and then what is asked of each."""
        views, *rest = key if isinstance(key, tuple) else (key,)
        if np.ndim(views) == 0 and not isinstance(views, slice):
            return self._view(int(views))[tuple(rest)]
        numbers = np.arange(len(self))[views]
        if any(not isinstance(part, slice) for part in rest):  # arrays of pixels, one for each view named
            own, place = np.unique(numbers, return_inverse=True)
            return np.stack([self._view(int(view)) for view in own])[(place, *rest)]
        if not numbers.size:
            return np.zeros((*numbers.shape, *np.zeros(self.shape[1:], bool)[tuple(rest)].shape), self.dtype)
        values = np.stack([self._view(int(view))[tuple(rest)] for view in numbers.ravel()])
        return values.reshape(*numbers.shape, *values.shape[1:])

    def fetch(self, views: np.ndarray) -> None:
        """Read views that are not in memory, so that they are when they are asked for."""
        for view in views:
            self._view(int(view))

    def shards(self) -> Iterator[np.ndarray]:
        """Read everything, file by file, in order; views stay in the cache while there is room."""
        step = (self._array.shards or self._array.chunks)[0]
        for first in range(0, len(self), step):
            values = np.asarray(self._array[first : first + step])
            for view, value in enumerate(values, start=first):
                if self._cache.held_bytes + value.nbytes <= self._cache.limit_bytes:
                    self._cache.put(self._number, view, value.copy())
            yield values

    def _view(self, view: int) -> np.ndarray:
        found = self._cache.get(self._number, view)
        if found is None:
            try:
                found = np.asarray(self._array[view])
            except (RuntimeError, ValueError, OSError) as error:
                where = f"view {view} of {self._array.store_path}"
                raise InputError(
                    f"{where} is damaged ({error})", "make the data set again: aug3d verify --repair"
                ) from error
            self._cache.put(self._number, view, found)
        return found
