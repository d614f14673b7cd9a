import numpy as np
import pandas as pd
import pytest

from aug3d_core.judging.config import EvaluationConfig
from aug3d_core.judging.summary import bootstrap, lead


def test_the_interval_narrows_with_the_groups():
    rng = np.random.default_rng(0)
    few, many = rng.normal(20, 2, 5), rng.normal(20, 2, 500)
    widths = [high - low for low, high in (bootstrap(v, 500, np.random.default_rng(1)) for v in (few, many))]
    assert widths[1] < widths[0] / 3


def test_a_lead_is_paired_and_over_groups():
    """Scores that differ much between groups, but always by the same, leave no doubt."""
    rng = np.random.default_rng(0)
    other = rng.normal(20, 5, 12)
    table = pd.DataFrame({"group": np.repeat(np.arange(6), 2), "psnr": other + 1, "other_psnr": other})
    mean, low, high = lead(table, "psnr", "other_psnr", EvaluationConfig())
    assert (mean, low, high) == pytest.approx((1, 1, 1))
    noisy = table.assign(psnr=other + rng.normal(0, 3, 12))
    mean, low, high = lead(noisy, "psnr", "other_psnr", EvaluationConfig())
    assert low < mean < high and high - low > 1
