"""Differences are paired, and orderings are decided by their intervals."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from aug3d_core.studies.paper.arm import Ordering
from aug3d_core.studies.paper.orderings import Difference, difference, judge_orderings


def scores(**arms: np.ndarray) -> pd.DataFrame:
    """Write a (seeds, photos) array of PSNR for each arm as the table that a study has."""
    rows = [
        {"arm": arm, "seed": seed, "fold": 0, "photo_id": photo, "psnr": values[seed, photo]}
        for arm, values in arms.items()
        for seed, photo in np.ndindex(values.shape)
    ]
    return pd.DataFrame(rows)


def test_one_photograph_decides_nothing() -> None:
    table = scores(a=np.full((3, 1), 20.0), b=np.full((3, 1), 10.0))
    assert difference(table, "a", "b").verdict == "not decided"


def test_a_hard_photograph_falls_out() -> None:
    hard = 30 * np.random.default_rng(0).random((1, 6))
    found = difference(scores(a=hard + 0.2 + np.zeros((3, 1)), b=hard + np.zeros((3, 1))), "a", "b")
    assert found.mean == pytest.approx(0.2) and found.verdict == "holds"
    assert found.interval == pytest.approx((0.2, 0.2))


def test_only_seeds_that_both_arms_finished_are_compared() -> None:
    rng = np.random.default_rng(0)
    one, other = rng.random((3, 4)), rng.random((2, 4))
    found = difference(scores(a=one, b=other), "a", "b")
    assert found.mean == pytest.approx((one[:2] - other).mean())
    alone = difference(scores(a=one), "a", "b")
    assert (alone.mean, alone.interval, alone.verdict) == (None, None, "not decided")


def test_an_arm_that_failed_in_a_fold_is_compared_with_nothing_and_a_seed_that_did_is_left_out() -> None:
    rng = np.random.default_rng(0)
    above = rng.normal(scale=0.1, size=(3, 12))
    table = scores(above=23 + above, below=20 - above)
    table["fold"] = table["photo_id"] // 6
    second, below = table["fold"] == 1, table["arm"] == "below"
    assert difference(table, "above", "below").verdict == "holds"
    lost = table[~(below & second)]
    for pair in (("above", "below"), ("below", "above")):
        found = difference(lost, *pair)
        assert (found.mean, found.interval, found.verdict) == (None, None, "not decided")
    one_seed = difference(table[~(below & second & (table["seed"] == 0))], "above", "below")
    assert one_seed.mean == pytest.approx(3 + 2 * above[1:].mean())


@pytest.mark.parametrize(
    ("interval", "verdict"),
    [
        ((0.1, 0.4), "holds"),
        ((-0.4, -0.1), "does not hold"),
        ((-0.1, 0.4), "not decided"),
        ((np.nan, np.nan), "not decided"),
        (None, "not decided"),
    ],
)
def test_an_interval_decides_when_zero_is_outside(interval: tuple[float, float] | None, verdict: str) -> None:
    assert Difference("a", "b", 0.0, interval).verdict == verdict


def test_an_ordering_holds_for_every_pair_or_not_at_all() -> None:
    rng = np.random.default_rng(0)
    noise = rng.normal(scale=0.05, size=(3, 6))
    table = scores(best=20 + noise, middle=19 + 0 * noise, low=18 - noise, unclear=20 + 20 * noise)
    claims = {
        "holds": (("best", "middle"), ("best", "low")),
        "does not hold": (("middle", "low"), ("middle", "best")),
        "not decided": (("best", "low"), ("best", "unclear")),
    }
    for verdict, pairs in claims.items():
        assert judge_orderings(table, [Ordering("a claim", pairs)])[0].verdict == verdict
