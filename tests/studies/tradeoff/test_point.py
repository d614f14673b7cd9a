"""Medians over seeds, what is on the front, and the cheapest that is enough."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.store.record import Record
from aug3d_core.studies.common.cell import Cell
from aug3d_core.studies.common.trial import Trial
from aug3d_core.studies.tradeoff.arm import TradeoffArm, TradeoffResult
from aug3d_core.studies.tradeoff.point import below, best, cheapest, on_front, points
from aug3d_core.studies.tradeoff.setting import POSE_ERROR, REPROJECTION, TEST_PSNR, Judge

numbers = st.floats(0.1, 100, allow_nan=False)


def result(
    label: str, seconds: float, figure: float | None, seed: int = 0, judge: Judge = TEST_PSNR, test: str = "t"
) -> TradeoffResult:
    metrics = {judge.figure: figure, judge.per or "x": 500.0}
    costs: dict[str, Any] = {"cpu_seconds": seconds, "seconds": seconds, "peak_mib": 1.0}
    record = Record.model_construct(stage=judge.stage, metrics=metrics, **costs)
    records = {} if figure is None else {judge.stage: record}
    mark = "preset" if label == "own" else ""
    return TradeoffResult(
        Cell(TradeoffArm("panel", label, (), judge, stages=(judge.stage,), mark=mark), seed),
        Trial(records),
        figures=metrics if records else {},
        held_out={test: figure or 0.0},
    )


def test_a_point_is_the_median_of_its_seeds_and_nothing_where_one_failed() -> None:
    told = [(1, 20.0), (9, 30.0), (2, 21.0)]
    [point] = points([result("a", s, f, i) for i, (s, f) in enumerate(told)])
    assert point.accuracy == 21.0 and point.cpu_seconds == 2 and len(point.results) == 3
    failed, sound = points(
        [*(result("a", s, f, i) for i, (s, f) in enumerate([*told, (5, None)])), result("b", 1.0, 9.0)]
    )
    assert failed.accuracy is None and best([failed, sound]) is sound and cheapest([failed, sound], 0) is sound
    assert on_front([failed, sound]) == [sound] and below(failed, sound) is None
    [lost] = points([result("a", 3.0, None)])
    assert lost.accuracy is None and lost.gain is None and best([lost]) is None and cheapest([lost], 0) is None


@given(st.lists(st.tuples(numbers, numbers), min_size=1, max_size=12))
def test_the_cheapest_that_is_enough_is_on_the_front(drawn: list[tuple[float, float]]) -> None:
    found = points([result(str(i), seconds, figure) for i, (seconds, figure) in enumerate(drawn)])
    for wanted in (min(f for _, f in drawn), max(f for _, f in drawn)):
        chosen = cheapest(found, wanted)
        assert chosen is not None and (chosen.accuracy or 0.0) >= wanted
        assert chosen.cpu_seconds in [point.cpu_seconds for point in on_front(found)]
    top = best(found)
    assert top is not None and top.accuracy == max(f for _, f in drawn)


def test_less_error_is_more_gain() -> None:
    found = points([result("a", 1.0, 0.5, judge=POSE_ERROR), result("b", 2.0, 0.1, judge=POSE_ERROR)])
    assert [point.arm.label for point in on_front(found)] == ["a", "b"]
    top = best(found)
    assert top is not None and top.arm.label == "b"


def test_scores_of_another_test_than_the_scenes_own_are_not_compared() -> None:
    found = points([result("own", 2.0, 20.0), result("odd", 1.0, 30.0, test="u"), result("same", 1.0, 19.0)])
    assert [point.comparable for point in found] == [True, False, True]
    assert [point.arm.label for point in on_front(found)] == ["same", "own"]


def test_the_scenes_own_test_is_known_from_any_of_its_runs() -> None:
    failed = replace(result("own", 2.0, None), held_out={})
    odd, same = result("odd", 1.0, 30.0, test="u"), result("same", 1.0, 19.0)
    found = points([failed, result("own", 2.0, 20.0, seed=1), odd, same])
    assert [point.comparable for point in found] == [True, False, True]
    assert [point.arm.label for point in on_front(found)] == ["same"]


def test_an_error_in_pixels_is_told_as_an_angle() -> None:
    assert result("a", 1.0, 0.25, judge=REPROJECTION).accuracy == 0.0005


def judged(label: str, psnr: dict[int, list[float]]) -> Any:
    """Return a point with the PSNR of each test photograph, by seed."""
    results = [
        replace(result(label, 1.0, float(np.mean(db)), seed), held_out={str(i): one for i, one in enumerate(db)})
        for seed, db in psnr.items()
    ]
    return points(results)[0]


def test_how_far_below_is_of_the_same_photographs_and_seeds() -> None:
    hard, easy = [12.0, 15.0, 18.0], [24.0, 26.0, 28.0]
    top = judged("top", {0: [*hard, *easy], 1: [db + 1 for db in (*hard, *easy)]})
    low = judged("low", {0: [db - 0.5 for db in (*hard, *easy)], 1: [db + 0.5 for db in (*hard, *easy)]})
    apart = below(low, top)
    assert apart is not None and apart.db == pytest.approx(0.5)
    assert apart.interval == pytest.approx((0.5, 0.5)), (
        "photographs that differ by 16 dB say nothing of how two points differ"
    )
    skewed = below(
        *(judged("p", {seed: [db, db] for seed, db in enumerate(of)}) for of in ((22.0,) * 3, (22.0, 22.0, 25.0)))
    )
    assert skewed is not None and skewed.db == pytest.approx(1.0) and skewed.interval is not None
    assert skewed.interval[0] <= skewed.db <= skewed.interval[1], "an interval is of what it stands beside"
    alone = below(judged("low", {0: [11.0, 14.0]}), judged("top", {0: [12.0, 15.0]}))
    assert alone is not None and alone.db == pytest.approx(1.0) and alone.interval is None, "one seed has no interval"


def test_other_tests_are_compared_on_what_they_share_if_that_is_enough() -> None:
    top = judged("top", {0: [20.0, 21.0, 22.0, 23.0, 24.0]})  # of photographs 0 to 4
    of_four = judged("low", {0: [19.0, 20.0, 21.0, 22.0]})
    apart = below(of_four, top)
    assert apart is not None and apart.db == pytest.approx(1.0)
    assert below(judged("low", {0: [19.0, 20.0]}), top) is None, "two photographs of another test say nothing"
    assert below(judged("low", {0: [19.0, 20.0]}), judged("top", {0: [20.0, 21.0]})) is not None, (
        "they are all there are"
    )
