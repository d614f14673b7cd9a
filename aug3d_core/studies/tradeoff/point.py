"""Time and accuracy of an arm: the medians over its seeds; and comparisons of points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from aug3d_core.report.front import front
from aug3d_core.split.split import LEAST_TARGETS
from aug3d_core.studies.common.statistics import interval
from aug3d_core.studies.tradeoff.arm import TradeoffArm, TradeoffResult


@dataclass(frozen=True)
class Point:
    """An arm with its results. comparable: whether its test is that of the others in its panel."""

    arm: TradeoffArm
    results: tuple[TradeoffResult, ...]
    comparable: bool = True

    @property
    def accuracy(self) -> float | None:
        """Median over the seeds; None if any seed has no figure."""
        figures = [result.accuracy for result in self.results if result.accuracy is not None]
        return median(figures) if len(figures) == len(self.results) else None

    @property
    def cpu_seconds(self) -> float:
        """Median over the seeds."""
        return median(result.cpu_seconds for result in self.results)

    @property
    def gain(self) -> float | None:
        """The accuracy, negated if lower is better; None where it cannot be compared."""
        if self.accuracy is None or not self.comparable:
            return None
        return -self.accuracy if self.arm.judge.lower_is_better else self.accuracy


@dataclass(frozen=True)
class Below:
    """How far a point is below another [dB]: the mean over shared seeds and over photographs.

    Without shared seeds it is the difference of the medians. interval: 95 %, of that mean; None for one seed or photograph.
    """

    db: float
    interval: tuple[float, float] | None


def below(point: Point, other: Point) -> Below | None:
    """Return how far a point is below another, on the test photographs that all their seeds share.

    Settings can move the split by a photograph. None if tests differ in size, or differ and share too few photographs, or if
    a seed failed.
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


def points(results: Sequence[TradeoffResult]) -> list[Point]:
    """Return the point of each arm, in order. A score of another test than that of the scene's own settings is marked."""
    by_arm: dict[TradeoffArm, list[TradeoffResult]] = {}
    for result in results:
        by_arm.setdefault(result.arm, []).append(result)
    usual = {arm.panel: own_test(results, arm.panel) for arm in by_arm}
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


def own_test(results: Sequence[TradeoffResult], panel: str) -> tuple[object, ...]:
    """Return the test of the scene's own settings, by the first of its runs that has one; empty where none has."""
    own = [result.test for result in results if result.arm.panel == panel and result.arm.mark == "preset"]
    return next(filter(None, own), ())
