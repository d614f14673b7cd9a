import numpy as np

from aug3d_core.judging.summary import bootstrap


def test_the_interval_narrows_with_the_groups():
    rng = np.random.default_rng(0)
    few, many = rng.normal(20, 2, 5), rng.normal(20, 2, 500)
    widths = [high - low for low, high in (bootstrap(v, 500, np.random.default_rng(1)) for v in (few, many))]
    assert widths[1] < widths[0] / 3
