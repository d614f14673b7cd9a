"""How much memory there is to use: the machine's, or what a container is given of it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil

_CGROUP = Path("/sys/fs/cgroup")
_LIMITS = ("memory.max", "memory/memory.limit_in_bytes")  # of control groups version 2 and 1


def total_bytes(cgroup: Path = _CGROUP) -> int:
    """Return the memory that all processes here may use together."""
    total = psutil.virtual_memory().total
    for name in _LIMITS:
        path = cgroup / name
        told = path.read_text().strip() if path.is_file() else "max"
        total = min(total, int(told)) if told.isdigit() else total
    return total


class MemoryBudget:
    """Memory that threads share: each takes what it is about to use, and waits until that much is left."""

    def __init__(self, total: int) -> None:
        """Begin with `total` bytes, all of them free."""
        self.total = total
        self._free = total
        self._changed = threading.Condition()

    @contextmanager
    def taking(self, needed: int) -> Iterator[None]:
        """Hold so many bytes; raises ValueError for more than the whole budget."""
        if needed > self.total:
            raise ValueError(f"{needed} bytes are more than the budget of {self.total}")
        with self._changed:
            self._changed.wait_for(lambda: self._free >= needed)
            self._free -= needed
        try:
            yield
        finally:
            with self._changed:
                self._free += needed
                self._changed.notify_all()
