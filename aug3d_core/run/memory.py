"""How much memory there is to use: the machine's, or what a container is given of it."""

from __future__ import annotations

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
