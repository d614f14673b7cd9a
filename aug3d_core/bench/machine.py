"""What a figure was measured on, in one line."""

from __future__ import annotations

import os
import platform
from datetime import UTC, datetime
from pathlib import Path

from aug3d_core.run.gpus import gpu_names
from aug3d_core.run.memory import total_bytes


def describe_machine() -> str:
    """Return processor, cores that this process may use, memory, GPUs, Python, and the day."""
    cores = len(os.sched_getaffinity(0))
    memory_gib = total_bytes() / 2**30
    day = datetime.now(UTC).date().isoformat()
    parts = [
        _processor(),
        f"{cores} cores",
        f"{memory_gib:.0f} GiB",
        *gpu_names(),
        f"Python {platform.python_version()}",
        day,
    ]
    return ", ".join(parts)


def _processor() -> str:
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
