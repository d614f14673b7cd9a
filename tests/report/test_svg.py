import math
import re
from xml.etree import ElementTree

from aug3d_core.report.svg import Bar, bars, curve


def widths(drawn: str) -> list[float]:
    return [float(rect.get("width")) for rect in ElementTree.fromstring(drawn).iter("rect")]


def test_bars_are_as_long_as_their_values():
    drawn = bars([Bar("a & b", 20.0, "20"), Bar("c", 5.0, "5", (4.0, 6.0)), Bar("d", None, "none")], "title")
    long, short, missing = widths(drawn)
    assert math.isclose(long, 4 * short, abs_tol=0.2)
    assert missing == 0
    whisker = re.search(r'class="whisker" d="M([\d.]+) [\d.]+H([\d.]+)', drawn)
    assert math.isclose(float(whisker[2]) - float(whisker[1]), 2 * short / 5, abs_tol=0.2)


def test_an_interval_beyond_the_longest_bar_still_fits():
    drawn = bars([Bar("a", 10.0, "10", (5.0, 20.0))], "title")
    assert float(re.search(r"H([\d.]+)", drawn)[1]) < 620


def test_curves_stay_inside_and_leave_out_what_is_not_a_number():
    drawn = curve([(0, 1.0), (10, math.nan), (20, 3.0), (30, -2.0)], "loss")
    path = re.search(r'class="line" d="M([^"]+)"', drawn)[1]
    places = [tuple(map(float, place.split())) for place in path.split("L")]
    assert len(places) == 3
    assert all(0 <= x <= 420 and 0 <= y <= 220 for x, y in places)
    assert places[1][1] < places[0][1] < places[2][1]  # up is more
    assert curve([(0, math.nan)], "loss") == ""
    ElementTree.fromstring(curve([(5, 2.0)], "one point"))
