import re
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.report.histogram import count_histogram, histogram


def heights(drawn: str) -> np.ndarray:
    return np.array([float(rect.attrib["height"]) for rect in ElementTree.fromstring(drawn).iter("rect")])


def test_bars_are_as_high_as_values_are_many():
    drawn = histogram(np.array([0.1] * 30 + [0.9] * 10 + [np.nan, np.inf]), "error (px)", "Points")
    tall = heights(drawn)
    assert sorted(tall[tall > 0]) == pytest.approx([tall.max() / 3, tall.max()], abs=0.2)
    assert "median 0.1" in drawn and "error (px)" in drawn


@given(st.lists(st.just(0.0) | st.floats(1e-9, 1e6), min_size=1, max_size=50))
def test_every_value_is_in_some_bar(values):
    drawn = histogram(np.array(values), "size", "Things")
    tall = heights(drawn)
    tick = re.findall(r'text class="tick"[^>]*text-anchor="end"[^>]*>([\d,]+)<', drawn)
    levels = [float(y) for y in re.findall(r'class="grid" d="M52 ([\d.]+)H', drawn)]
    if len(tick) > 1:  # the ticks tell how high one value is
        one = (levels[0] - levels[1]) / (int(tick[1].replace(",", "")) - int(tick[0].replace(",", "")))
        assert tall.sum() / one == pytest.approx(len(values), rel=0.02)
    assert tall.max() <= 220


def test_whole_numbers_have_a_bar_each_and_the_last_stands_for_more():
    drawn = count_histogram({2: 5, 3: 10, 4: 0, 5: 2}, "photographs", "Points")
    assert heights(drawn)[1] == pytest.approx(2 * heights(drawn)[0], abs=0.2) and len(heights(drawn)) == 4
    assert ">2<" in drawn and ">5+<" in drawn


def test_nothing_to_count_is_no_chart():
    assert histogram(np.array([np.nan]), "size", "Things") == "" == count_histogram({1: 0, 2: 0}, "a", "b")
    assert heights(histogram(np.zeros(3), "size", "Things")).max() > 0
