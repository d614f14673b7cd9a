import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.judging.summary import CHEAP, interval, lead, runs_of_neighbours, summary


@pytest.mark.parametrize("count", [2, 4, 20, 92])
def test_the_interval_holds_the_mean_19_times_of_20(count):
    """Of few values, too: resampling 4 values holds it 16 times of 20."""
    drawn = np.random.default_rng(0).normal(20, 2, (4000, count))
    low, high = np.transpose([interval(values) for values in drawn])
    assert np.mean((low < 20) & (high > 20)) == pytest.approx(0.95, abs=0.012)


@pytest.mark.parametrize("count", [24, 60, 92])
def test_neighbours_that_are_alike_make_the_interval_no_narrower_than_it_is(count):
    """Taken for independent, these hold the mean 15 times of 20."""
    noise = np.random.default_rng(0).normal(0, 1, (4000, count + 2))
    alike = 20 + (noise[:, 2:] + noise[:, 1:-1] + noise[:, :-2]) / 3  # each shares two thirds with the next
    low, high = np.transpose([interval(values) for values in alike])
    assert np.mean((low < 20) & (high > 20)) > 0.9


@given(st.integers(1, 300), st.integers(1, 3))
def test_runs_of_neighbours_are_never_too_few_nor_longer_than_said(count, rows):
    values = np.arange(count * rows, dtype=float).reshape(rows, count)
    runs = runs_of_neighbours(values)
    assert runs.shape == (rows, runs.shape[1]) and min(count, 8) <= runs.shape[1] <= count
    assert count / runs.shape[1] < 9 and (count >= 16 or np.array_equal(runs, values))
    assert (np.diff(runs, axis=1) > 0).all()


def test_one_photograph_has_no_interval():
    assert interval(np.array([20.0])) is None
    columns = {f"{name}_{score}": [18.0] for name in CHEAP for score in ("psnr", "ssim", "flip")}
    figures = summary(pd.DataFrame({"group": [0], "psnr": [20.0], "ssim": [0.5], "flip": [0.2], **columns}))
    assert figures["test_psnr_mean"] == 20 and figures["over_best_cheap_db"] == 2
    assert {value for name, value in figures.items() if "_ci_" in name} == {None}


def test_a_lead_is_paired():
    """Scores that differ much between views, but always by the same, leave no doubt."""
    rng = np.random.default_rng(0)
    other = rng.normal(20, 5, 12)
    table = pd.DataFrame({"psnr": other + 1, "other_psnr": other})
    mean, ends = lead(table, "psnr", "other_psnr")
    assert (mean, *(ends or ())) == pytest.approx((1, 1, 1))
    noisy = table.assign(psnr=other + rng.normal(0, 3, 12))
    mean, (low, high) = lead(noisy, "psnr", "other_psnr")
    assert low < mean < high and high - low > 1
