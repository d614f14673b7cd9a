"""Growth is told for twice the photographs, and recall of pairs against points that are seen together."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.bench.scale import growth, town_of
from aug3d_core.studies.common.trial import Measured
from aug3d_core.town.drone.flight import plan_flight


@given(st.floats(0, 2.5), st.floats(0.1, 100))
def test_growth_is_two_to_the_power_of_the_exponent(exponent: float, unit_s: float) -> None:
    seconds = {count: {"depth": unit_s * count**exponent} for count in (58, 121, 250, 1010)}
    assert growth(seconds)["growth_depth"].value == pytest.approx(2**exponent)


def test_the_worst_rise_counts_and_matching_may_rise_more() -> None:
    seconds = {
        60: {"depth": 10.0, "matching": 10.0},
        120: {"depth": 15.0, "matching": 24.0},
        240: {"depth": 36.0, "matching": 50.0},
    }
    found = growth(seconds)
    assert found["growth_depth"].value == pytest.approx(2.4) and found["growth_depth"].holds is False
    assert found["growth_matching"].value == pytest.approx(2.4) and found["growth_matching"].holds is True


def test_one_size_tells_no_growth() -> None:
    assert growth({60: {"depth": 10.0}})["growth_depth"].value is None


@pytest.mark.parametrize("photos", [15, 60, 120, 1000])
def test_a_town_grows_with_its_photographs(photos: int) -> None:
    town = town_of(Measured("tiny"), photos).config().town
    assert len(plan_flight(town, np.random.default_rng(0))) == pytest.approx(photos, rel=0.1, abs=4)
    assert math.isclose(town.length_m / town.width_m, 220 / 130, rel_tol=0.02)
