"""What an estimate says: ranges of time, memory and disk."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Range:
    """A figure that is not known exactly: `likely`, and within what bounds."""

    low: float
    likely: float
    high: float

    def times(self, factor: float) -> Range:
        """Return the range of so many times the figure."""
        return Range(self.low * factor, self.likely * factor, self.high * factor)


def about(likely: float, factor: float) -> Range:
    """Return what may be so many times less or more."""
    return Range(likely / factor, likely, likely * factor)


def together(ranges: Iterable[Range]) -> Range:
    """Return the range of a sum. Low ends add up, and high ends: what one law has wrong about a scene, the next has too."""
    listed = list(ranges)
    return Range(sum(r.low for r in listed), sum(r.likely for r in listed), sum(r.high for r in listed))


@dataclass(frozen=True)
class Cost:
    """What a step takes: wall time [s], memory at the peak, over all its processes [MiB], what it leaves on the disk [MiB]."""

    seconds: Range
    peak_mib: Range
    disk_mib: Range
