"""Time and accuracy of an arm: the medians over its seeds; and what follows from all points of a panel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from aug3d_core.charts.front import front
from aug3d_core.grouping.split import LEAST_TARGETS
from aug3d_core.study.statistics import interval
from aug3d_core.tradeoff.arm import Arm, Result


@dataclass(frozen=True)
class Point:
    """An arm with its results. comparable: whether its score is of the same test as the others' of its panel."""

    arm: Arm
    results: tuple[Result, ...]
    comparable: bool = True

    @property
    def accuracy(self) -> float | None:
        """Median over the seeds; None where a seed has no figure: what fails now and then has failed."""
        told = [result.accuracy for result in self.results if result.accuracy is not None]
        return median(told) if len(told) == len(self.results) else None

    @property
    def cpu_seconds(self) -> float:
        """Median over the seeds."""
        return median(result.cpu_seconds for result in self.results)

    @property
    def gain(self) -> float | None:
        """The accuracy so that more is better; None where it is not to be compared."""
        if self.accuracy is None or not self.comparable:
            return None
        return -self.accuracy if self.arm.judge.lower_is_better else self.accuracy


@dataclass(frozen=True)
class Below:
    """How far a point is below another (dB): the mean over the seeds that both have and over their photographs.

    Where they share no seed, the difference of their medians. interval: 95 %, of that mean; None for one of either.
    """

    db: float
    interval: tuple[float, float] | None


def below(point: Point, other: Point) -> Below | None:
    """Return how far a point is below another, on the test photographs that all their seeds share.

    Settings can move the split by a photograph. None where tests differ and share too few to say anything, or in size, and
    where a seed failed.
    """
    results = [*point.results, *other.results]
    if point.accuracy is None or other.accuracy is None or len({result.size_px for result in results}) > 1:
        return None
    shared = sorted(set.intersection(*(set(result.held_out) for result in results)))
    if not shared or (len(shared) < LEAST_TARGETS and len({result.test for result in results}) > 1):
        return None
    mine, its = ({r.seed: np.array([r.held_out[name] for name in shared]) for r in p.results} for p in (point, other))
    apart = [its[seed] - mine[seed] for seed in sorted(mine.keys() & its.keys())]
    if apart:
        return Below(float(np.mean(apart)), interval(np.array(apart)))
    level_mine, level_its = (median(float(psnr.mean()) for psnr in by_seed.values()) for by_seed in (mine, its))
    return Below(level_its - level_mine, None)


def points(results: Sequence[Result]) -> list[Point]:
    """Return the point of each arm, in order; scores of another test than most of their panel have are marked."""
    by_arm: dict[Arm, list[Result]] = {}
    for result in results:
        by_arm.setdefault(result.arm, []).append(result)
    usual = {arm.panel: _own(by_arm, arm.panel) for arm in by_arm}
    return [
        Point(arm, tuple(tried), not usual[arm.panel] or all(r.test in ((), usual[arm.panel]) for r in tried))
        for arm, tried in by_arm.items()
    ]


def on_front(found: Sequence[Point]) -> list[Point]:
    """Return the points that no other beats in time and accuracy, fastest first."""
    able = [point for point in found if point.gain is not None]
    return [able[i] for i in front([p.cpu_seconds for p in able], [p.gain or 0.0 for p in able])]


def best(found: Sequence[Point]) -> Point | None:
    """Return the most accurate point."""
    able = [point for point in found if point.gain is not None]
    return max(able, key=lambda point: point.gain or 0.0, default=None)


def cheapest(found: Sequence[Point], least: float) -> Point | None:
    """Return the fastest point that gains at least so much."""
    able = [point for point in found if point.gain is not None and point.gain >= least]
    return min(able, key=lambda point: point.cpu_seconds, default=None)


def _own(by_arm: dict[Arm, list[Result]], panel: str) -> tuple[object, ...]:
    """Return the test of the scene's own settings."""
    own = [
        result.test for arm, tried in by_arm.items() for result in tried if arm.panel == panel and arm.mark == "preset"
    ]
    return next(iter(own), ())
