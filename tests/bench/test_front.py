"""The Pareto front holds what nothing beats, and the chart shows every point, failed ones too."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from aug3d_core.bench.front import Point, draw, front, table

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


def point(value: str, seconds: float, accuracy: float | None, setting: str = "features") -> Point:
    return Point(setting, value, value == "2", seconds, 500.0, accuracy, "position_error_pct", "" if accuracy else "no")


def test_the_chart_is_drawn_with_failures_and_several_settings(tmp_path: Path) -> None:
    points = [point("1", 10, 0.2), point("2", 20, 0.1), point("3", 40, None), *(point("1", 5, 1, s) for s in "abcd")]
    draw(points, frozenset({"position_error_pct"}), "title", tmp_path / "chart.png")
    with Image.open(tmp_path / "chart.png") as image:
        assert image.width > 1000 and image.convert("L").getextrema()[0] < 100


def test_the_table_keeps_every_point_and_why_it_failed(tmp_path: Path) -> None:
    table([point("1", 10, 0.2), point("3", 40, None)]).to_parquet(tmp_path / "points.parquet")
    rows = pd.read_parquet(tmp_path / "points.parquet")
    assert list(rows["value"]) == ["1", "3"]
    assert rows["failure"].tolist() == ["", "no"]
    assert rows["accuracy"].isna().tolist() == [False, True]
