"""How long a run will still take: what each step is estimated at, corrected by what the run has taken so far."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

_TRUSTED_S = 15.0  # of estimated time, that the estimate is worth beside what was measured
_OWN_SHARE = 0.1  # of a step's work, from where its own pace counts more than the estimate
_LEAST_LEFT = 0.1  # of its time, that a step still needs which takes longer than expected


@dataclass
class _Running:
    since_s: float
    share: float = 0.0


class TimeLeft:
    """Follows a run; times are of any one clock [s]."""

    def __init__(self, expected_s: Mapping[str, float]) -> None:
        """Begin with what each step that is not there yet is expected to take."""
        self._expected_s = dict(expected_s)
        self._running: dict[str, _Running] = {}
        self._taken_s = self._expected_of_taken_s = 0.0

    def add(self, step: str, expected_s: float) -> None:
        """Add a step that the run turns out to have."""
        self._expected_s[step] = expected_s

    def started(self, step: str, now_s: float) -> None:
        """A step begins."""
        if step in self._expected_s:
            self._running[step] = _Running(now_s)

    def advanced(self, step: str, share: float) -> None:
        """A step has done so much of its work (0 to 1)."""
        if step in self._running:
            self._running[step].share = min(max(share, 0.0), 1.0)

    def finished(self, step: str, now_s: float, *, cached: bool) -> None:
        """A step is there. If it was there before, it tells nothing of the machine's pace."""
        expected_s, running = self._expected_s.pop(step, None), self._running.pop(step, None)
        if expected_s is not None and running is not None and not cached:
            self._taken_s += now_s - running.since_s
            self._expected_of_taken_s += expected_s

    def seconds(self, now_s: float) -> float:
        """Return how long the run will still take [s]."""
        at_work = [
            (self._expected_s[step], running.share, now_s - running.since_s) for step, running in self._running.items()
        ]
        taken_s = self._taken_s + sum(elapsed_s for _, share, elapsed_s in at_work if share)
        expected_s = self._expected_of_taken_s + sum(expected * share for expected, share, _ in at_work)
        pace = (taken_s + _TRUSTED_S) / (expected_s + _TRUSTED_S)
        waiting_s = sum(expected for step, expected in self._expected_s.items() if step not in self._running)
        return pace * waiting_s + sum(_left(pace * expected, share, elapsed) for expected, share, elapsed in at_work)


def _left(expected_s: float, share: float, elapsed_s: float) -> float:
    """Return what a step still takes: by what was expected at first, by its own pace the further it is."""
    if not share:
        return max(expected_s - elapsed_s, _LEAST_LEFT * expected_s)
    own = share / (share + _OWN_SHARE)
    return (1 - share) * (own * elapsed_s / share + (1 - own) * expected_s)
