import numpy as np
import pandas as pd
import pytest

from aug3d_core.judging.summary import CHEAP, interval, lead, summary


@pytest.mark.parametrize("count", [2, 4, 20])
def test_the_interval_holds_the_mean_19_times_of_20(count):
    """Of few values, too: resampling 4 values holds it 16 times of 20."""
    drawn = np.random.default_rng(0).normal(20, 2, (4000, count))
    low, high = np.transpose([interval(values) for values in drawn])
    assert np.mean((low < 20) & (high > 20)) == pytest.approx(0.95, abs=0.012)


def test_one_photograph_has_no_interval():
    assert interval(np.array([20.0])) is None
    columns = {f"{name}_{score}": [18.0] for name in CHEAP for score in ("psnr", "ssim", "flip")}
    figures = summary(pd.DataFrame({"group": [0], "psnr": [20.0], "ssim": [0.5], "flip": [0.2], **columns}))
    assert figures["test_psnr_mean"] == 20 and figures["over_best_cheap_db"] == 2
    assert {value for name, value in figures.items() if "_ci_" in name} == {None}


def test_a_lead_is_paired_and_over_groups():
    """Scores that differ much between groups, but always by the same, leave no doubt."""
    rng = np.random.default_rng(0)
    other = rng.normal(20, 5, 12)
    table = pd.DataFrame({"group": np.repeat(np.arange(6), 2), "psnr": other + 1, "other_psnr": other})
    mean, ends = lead(table, "psnr", "other_psnr")
    assert (mean, *(ends or ())) == pytest.approx((1, 1, 1))
    noisy = table.assign(psnr=other + rng.normal(0, 3, 12))
    mean, (low, high) = lead(noisy, "psnr", "other_psnr")
    assert low < mean < high and high - low > 1
