"""The spread of errors is that of the good ones."""

from __future__ import annotations

import numpy as np
import pytest

from aug3d_core.geometry.robust import spread


@pytest.mark.parametrize("std", [0.01, 1.0, 300.0])
def test_the_spread_of_normal_errors_is_their_standard_deviation(std: float) -> None:
    assert spread(np.random.default_rng(0).normal(0, std, 100_000)) == pytest.approx(std, rel=0.02)


def test_wild_errors_hardly_count() -> None:
    off = np.random.default_rng(0).normal(0, 1, 10_000)
    off[:1000] = 1e6
    assert spread(off) == pytest.approx(1, rel=0.2)
    assert spread(-off) == spread(off)
