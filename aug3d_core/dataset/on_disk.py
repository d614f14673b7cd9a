"""Pictures of a packed scene that stay on disk until they are asked for: training sees many scenes in bounded memory."""

from __future__ import annotations

import itertools
import threading
from collections import OrderedDict
from collections.abc import Iterator
from typing import Any

import numpy as np

from aug3d_core.dataset.by_view import ByView
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


class OnDisk(ByView):
    """A Zarr array with one chunk for each view."""

    def __init__(self, array: Any, cache: Cache) -> None:  # zarr itself is heavy to import, and reads of itself
        super().__init__(array.shape, array.dtype)
        self._array, self._cache, self._number = array, cache, next(_NUMBERS)

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
