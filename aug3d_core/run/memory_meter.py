"""Memory of a job by its shares (PSS): of a page that two processes share, each is counted half.

The kernel walks through all pages to tell it: 25 ms for each GiB of a process (measured). Resident memory (RSS) is told at
once and is never less, so it says when there is no need to ask.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress

import psutil

_REST = 50.0  # times as long as the last look took: a look costs 2 % of a core at most


class MemoryMeter:
    """The most memory that a job was seen to use [bytes], however many processes it has."""

    def __init__(self, limit_bytes: float) -> None:
        """limit_bytes: looked at without rest where the job may have passed it."""
        self.peak_bytes = 0
        self._limit_bytes = limit_bytes
        self._shared_bytes = 0  # by how much resident memory told too much at the last look
        self._rested_at = 0.0

    def look(self, job: Sequence[psutil.Process]) -> None:
        """Look at the processes that the job has now."""
        resident = sum(map(_resident_bytes, job))
        rested = time.monotonic() >= self._rested_at
        if resident - self._shared_bytes > self._limit_bytes or (rested and resident > self.peak_bytes):
            started = time.monotonic()
            used = sum(map(_share_bytes, job))
            ended = time.monotonic()
            self.peak_bytes = max(self.peak_bytes, used)
            self._shared_bytes = max(0, resident - used)
            self._rested_at = ended + _REST * (ended - started)


def _resident_bytes(process: psutil.Process) -> int:
    with suppress(psutil.NoSuchProcess):
        return process.memory_info().rss
    return 0


def _share_bytes(process: psutil.Process) -> int:
    """Return a process's share, or its resident memory where the kernel does not tell the share."""
    with suppress(psutil.AccessDenied, psutil.NoSuchProcess, AttributeError):
        return process.memory_full_info().pss  # pyright: ignore[reportAttributeAccessIssue]
    return _resident_bytes(process)
