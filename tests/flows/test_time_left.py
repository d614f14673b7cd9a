"""The time left is right within a factor of 1.5 after a tenth of a run, on machines of any speed."""

from __future__ import annotations

import numpy as np
import pytest

from flows.time_left import TimeLeft

EXPECTED_S = {
    "town": 100.0,
    "matching": 60.0,
    "sfm": 40.0,
    "depth": 120.0,
    "surface": 120.0,
    "training": 360.0,
    "evaluation": 25.0,
}


def told(slowness: float, wrong: dict[str, float], checks: int = 400) -> list[tuple[float, float]]:
    """Return the time left as it is and as it is told, at many moments after a tenth of a run."""
    takes = {step: expected * slowness * wrong[step] for step, expected in EXPECTED_S.items()}
    whole, left, pairs, begun = sum(takes.values()), TimeLeft(EXPECTED_S), [], 0.0
    for step, seconds in takes.items():
        left.started(step, begun)
        for part in np.linspace(0, 1, max(int(checks * seconds / whole), 2))[:-1]:
            left.advanced(step, part)
            now = begun + part * seconds
            if now >= 0.1 * whole:
                pairs.append((whole - now, left.seconds(now)))
        begun += seconds
        left.finished(step, begun, cached=False)
    assert left.seconds(begun) == 0
    return pairs


@pytest.mark.parametrize("slowness", [0.3, 1.0, 3.0, 5.0])
def test_it_is_right_after_a_tenth_whatever_the_machine(slowness: float) -> None:
    """At most moments of most runs: of few, a stage that was estimated far too high comes first."""
    rng, ratios = np.random.default_rng(0), []
    for _ in range(40):
        off = np.exp(rng.uniform(-0.25, 0.25, len(EXPECTED_S)))
        ratios += [told_s / true_s for true_s, told_s in told(slowness, dict(zip(EXPECTED_S, off, strict=True)))]
    assert np.mean([1 / 1.5 < ratio < 1.5 for ratio in ratios]) > 0.95


def test_what_is_cached_takes_no_time_and_tells_no_pace() -> None:
    left = TimeLeft({"town": 100.0, "depth": 50.0})
    left.started("town", 0.0)
    left.finished("town", 1.0, cached=True)
    assert left.seconds(1.0) == pytest.approx(50.0)


def test_a_step_without_progress_is_never_past_its_end() -> None:
    left = TimeLeft({"surface": 100.0})
    left.started("surface", 0.0)
    assert left.seconds(30.0) == pytest.approx(70.0)
    assert left.seconds(500.0) == pytest.approx(10.0)


def test_folds_that_turn_up_add_to_it() -> None:
    left = TimeLeft({"depth": 100.0})
    left.add("depth 2", 80.0)
    assert left.seconds(0.0) == pytest.approx(180.0)


def test_steps_that_nobody_estimated_are_left_out() -> None:
    left = TimeLeft({})
    left.started("depth", 0.0)
    left.advanced("depth", 0.5)
    left.finished("depth", 9.0, cached=False)
    assert left.seconds(9.0) == 0
