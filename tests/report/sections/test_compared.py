import re

from aug3d_core.metrics.comparison import Comparison, Gain, Row
from aug3d_core.report.sections.compared import beside_published


def comparison(**changes) -> Comparison:
    psnr = Row("nvs.test_psnr_mean", (21.5, 22.0), (0.0, 0.0233), (None, True))
    seconds = Row("work_seconds", (100.0, 300.0), (0.0, 2.0), (None, False))
    setting = Row("training.<b>", ("1", "2"), (None, None), (None, None))
    values = {
        "runs": ("s@<old>", "s@new"), "not_comparable": "", "lacks": ((), ()), "psnr_intervals": ((21.0, 22.0), (21.5, 22.5)),
        "gains": (None, None),
        "about": (), "headline": (psnr, seconds), "params": (setting,), "metrics": (),
    }  # fmt: skip
    return Comparison(**(values | changes))


def test_figures_stand_before_and_now_with_what_is_better():
    page = beside_published(comparison())
    rows = re.findall("<tr><td.*?</tr>", page)
    assert ">21.5<" in rows[0] and ">22<" in rows[0] and "+0.50 dB" in rows[0] and 'class="ok">better' in rows[0]
    assert "+200 %" in rows[1] and 'class="refused">worse' in rows[1]
    assert "may be chance" in page and "s@&lt;old&gt;" in page
    assert "Settings that differ: 1" in page and "training.&lt;b&gt;" in page and "Metrics that differ" not in page


def test_photographs_tell_more_than_intervals_do():
    page = beside_published(comparison(gains=(None, Gain(7, 0.5, (0.21, 0.79)))))
    assert "+0.50 dB [+0.21, +0.79] over the same 7 photographs." in page and "chance" not in page
    page = beside_published(comparison(gains=(None, Gain(7, 0.5, (-0.21, 1.21)))))
    assert "may be chance" in page


def test_scores_that_say_nothing_about_each_other_are_said_to():
    page = beside_published(comparison(not_comparable="other test photographs"))
    assert "The scores cannot be compared: other test photographs." in page and "chance" not in page


def test_the_first_version_is_compared_with_nothing():
    assert beside_published(None) == ""
