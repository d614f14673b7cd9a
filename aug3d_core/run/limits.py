"""How long a stage may run and how much memory it may use before it is killed; how much a home keeps of a shared store.

These are limits of the machine, not of the scene. They come from the environment, which reaches a run wherever it is
started, and are no part of a key: changing one computes nothing again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from aug3d_core.run.errors import UsageError
from aug3d_core.run.memory import total_bytes

LIMIT_HOURS, LIMIT_MEMORY = "AUG3D_LIMIT_HOURS", "AUG3D_LIMIT_MEMORY_GIB"
CACHE = "AUG3D_CACHE_GIB"
_HOURS = 7 * 24.0
_MEMORY_SHARE = 0.9  # of what the machine, or the container, has
_CACHE_SHARE = 0.5  # of the disk


@dataclass(frozen=True)
class Limits:
    """Of one stage, over all its processes."""

    seconds: float
    mib: float


def limits_from(environment: Mapping[str, str]) -> Limits:
    """Return the limits; raises UsageError that names the variable whose value cannot be right."""
    hours = _positive(environment, LIMIT_HOURS, _HOURS, "hours")
    gib = _positive(environment, LIMIT_MEMORY, _MEMORY_SHARE * total_bytes() / 2**30, "GiB")
    return Limits(hours * 3600, gib * 1024)


def cache_bytes_from(environment: Mapping[str, str], disk_bytes: int) -> float:
    """Return how much a home keeps of what a shared store has; raises UsageError if the variable cannot be right."""
    return _positive(environment, CACHE, _CACHE_SHARE * disk_bytes / 2**30, "GiB") * 2**30


def _positive(environment: Mapping[str, str], name: str, default: float, unit: str) -> float:
    told = environment.get(name, "").strip()
    try:
        value = float(told) if told else default
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise UsageError(
            f"{name} is {told!r}, which is no number of {unit} above 0",
            f"give one, or leave {name} out: the limit is then {default:.1f} {unit}",
        )
    return value
