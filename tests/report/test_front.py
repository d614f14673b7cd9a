"""The Pareto front holds what nothing beats, and the chart shows every point, failed ones too."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from PIL import Image

from aug3d_core.report.front import Dot, Panel, draw, front, near, ticks
from aug3d_core.report.front_html import _floor, panel_html, script

numbers = st.floats(0.1, 100, allow_nan=False)


@given(st.lists(st.tuples(numbers, numbers), min_size=1, max_size=20))
def test_nothing_beats_the_front_and_the_front_beats_the_rest(points: list[tuple[float, float]]) -> None:
    seconds, gain = [p[0] for p in points], [p[1] for p in points]
    chosen = front(seconds, gain)
    assert [seconds[i] for i in chosen] == sorted(seconds[i] for i in chosen)
    for i in range(len(points)):
        beaten = any(
            seconds[j] <= seconds[i] and gain[j] >= gain[i] and (seconds[j], gain[j]) != (seconds[i], gain[i])
            for j in range(len(points))
        )
        if i in chosen:
            assert not beaten
        elif (seconds[i], gain[i]) not in [(seconds[j], gain[j]) for j in chosen]:
            assert beaten


@given(st.lists(st.tuples(numbers, numbers), max_size=20))
def test_every_point_is_labelled_once(points: list[tuple[float, float]]) -> None:
    groups = near([p[0] for p in points], [p[1] for p in points], 0.35)
    assert sorted(i for group in groups for i in group) == list(range(len(points)))


def test_points_in_one_place_share_a_label() -> None:
    assert sorted(map(sorted, near([1, 1.01, 5], [2, 2.01, 9], 0.35))) == [[0, 1], [2]]


@given(st.lists(numbers, min_size=1, max_size=8))
@example([99.875])
def test_ticks_are_few_and_near_the_values(values: list[float]) -> None:
    found = ticks(values)
    assert 1 <= len(found) <= 6
    assert found == sorted(found)
    assert min(found) >= min(values) / 10
    assert max(found) <= max(values) * 10


def test_ticks_of_a_narrow_range_are_round_numbers_within_reach_of_it() -> None:
    assert ticks([54, 112]) == [60, 80, 100]
    assert ticks([87, 140]) == [100, 120, 140], "one distance from each to the next"
    assert ticks([0.0024, 0.0029]) == pytest.approx([0.0024, 0.0026, 0.0028, 0.003])
    assert ticks([1, 1000]) == [1, 10, 100, 1000]


def dot(label: str, seconds: float, accuracy: float | None, **more: Any) -> Dot:
    return Dot(label, seconds, accuracy, ((seconds, accuracy or 0.0),) * 2, **more)


DOTS = (
    dot("small", 10, 0.2),
    dot("usual", 20, 0.1, mark="preset", interval=(0.05, 0.15)),
    dot("picked", 25, 0.09, mark="chosen"),
    dot("elsewhere", 5, 0.01, off=True),
    dot("huge <b>", 40, None),
)
PANELS = [Panel("all of it", "PSNR (dB)", False, DOTS, labelled=False), Panel("some", "error (%)", True, DOTS)]


def test_what_was_judged_elsewhere_or_failed_is_on_no_front() -> None:
    assert [dot.label for dot in PANELS[0].on_front] == ["small"]
    assert [dot.label for dot in PANELS[1].on_front] == ["small", "usual", "picked"]


def test_the_chart_is_drawn_with_failures_and_several_panels(tmp_path: Path) -> None:
    draw([*PANELS, *(Panel(name, "error", True, DOTS[:1]) for name in "abc")], "title", tmp_path / "chart.png")
    with Image.open(tmp_path / "chart.png") as image:
        assert image.width > 1000 and image.convert("L").getextrema()[0] < 100


@pytest.mark.parametrize("columns", [1, 2, 3])
def test_a_long_title_stays_within_the_chart(columns: int, tmp_path: Path) -> None:
    panels = [Panel(name, "error", True, DOTS[:1]) for name in "abc"[:columns]]
    draw(panels, "town, preset tiny\n" + "dataset.height_px=72 " * 20, tmp_path / "chart.png")
    grey = np.asarray(Image.open(tmp_path / "chart.png").convert("L"))
    assert (grey[:, [0, -1]] == 255).all()


def test_a_panel_of_failures_alone_is_drawn(tmp_path: Path) -> None:
    panel = Panel("broken", "error", True, DOTS[-1:])
    draw([panel], "title", tmp_path / "chart.png")
    assert "failed" in panel_html(panel)


def test_where_labels_would_cover_each_other_numbers_stand_for_names() -> None:
    beside, keyed = PANELS[1], PANELS[0]
    assert sorted(sorted(texts) for _, texts in beside.labels) == [["elsewhere"], ["picked", "usual"], ["small"]]
    assert sorted(texts for _, texts in keyed.labels) == [["1"], ["2"], ["3"], ["4"]]
    page = panel_html(keyed)
    rows = [re.findall(r"<td[^>]*>(?:<span[^>]*>)?([^<]*)", row) for row in page.split("<tr>")[2:]]
    assert [row[:3] + row[4:] for row in rows] == [
        ["1", "elsewhere", "0.01000", "2", ""],
        ["2", "small", "0.2000", "2", "nothing"],
        ["3", "usual", "0.1000", "2", ""],
        ["4", "picked", "0.09000", "2", ""],
    ]
    assert "<table" not in panel_html(beside)


def test_of_many_dots_the_front_and_the_marked_are_named() -> None:
    many = tuple(dot(str(i), 10 + i, 5.0 - (i > 0) - 0.1 * i) for i in range(30))
    panel = Panel("all of it", "PSNR", False, (*many, dot("auto", 50, 1.0, mark="auto")), labelled=False)
    assert [one.label for one in panel.named] == ["0", "auto"]
    few = Panel("all of it", "PSNR", False, many[:20], labelled=False)
    assert len(few.named) == 20


@pytest.mark.parametrize("panel", PANELS, ids=lambda panel: panel.title)
def test_the_page_says_what_a_pointer_is_told_and_needs_no_network(panel: Panel) -> None:
    page = panel_html(panel)
    for said in ("as the scene has it", "chosen", "another test", "failed", panel.axis_name.partition(" (")[0]):
        assert said in page
    assert 'src="http' not in page and "cdn" not in page
    assert script().startswith("<script>") and "Plotly" in script()


def test_an_interval_does_not_push_the_dots_together() -> None:
    far = dot("usual", 20, 0.1, mark="preset", interval=(-50.0, 50.0))
    panel = Panel("all of it", "PSNR (dB)", False, (far, dot("small", 10, 0.2)), labelled=False)
    assert (min(panel.heights), max(panel.heights)) == (0.1, 0.2)
    assert [one.label for one in panel.named] == ["small", "usual"]


@pytest.mark.parametrize("lower_is_better", [True, False])
@given(heights=st.lists(st.lists(st.floats(0.1, 30), min_size=1, max_size=3), min_size=1, max_size=5))
def test_failures_lie_below_every_dot_and_every_seed(lower_is_better: bool, heights: list[list[float]]) -> None:
    dots = tuple(Dot(str(i), 1.0 + i, h[0], tuple((1.0, y) for y in h)) for i, h in enumerate(heights))
    floor = _floor(Panel("all", "figure", lower_is_better, (*dots, dot("gone", 3, None))))
    known = [y for one in heights for y in one]
    assert floor > max(known) if lower_is_better else floor < min(known)


def test_auto_is_a_triangle_though_another_test_judged_it() -> None:
    page = panel_html(Panel("all of it", "PSNR", False, (*DOTS, dot("auto", 7, 0.3, mark="auto", off=True))))
    assert "triangle-up-open" in page and "auto, another test" in page and "tried, another test" in page


def test_no_bar_of_an_interval_is_turned_over() -> None:
    page = panel_html(Panel("all", "PSNR", False, (dot("usual", 20, 22.0, mark="preset", interval=(22.5, 23.5)),)))
    assert '"array":[1.5]' in page and '"arrayminus":[0.0]' in page
