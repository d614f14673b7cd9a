import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from aug3d_core.report.ground_coverage import overlap_frame, seen_by
from aug3d_core.report.top_view import Frame
from tests.report.made_up_run import flight


def test_level_ground_is_counted_as_geometry_says():
    views = flight()
    frame = Frame(np.array([-40.0, -40.0]), np.array([140.0, 70.0]), 1.0)
    heights = np.zeros((110, 180))
    heights[0, 0] = np.nan
    seen = seen_by(heights, frame, views)
    row, column = np.nonzero(np.isfinite(heights))
    x, y = column - 40 + 0.5, 70 - row - 0.5
    expected = sum(
        ((np.abs(x - 20 * i) < 30) & (np.abs(y - 30 * strip) < 20)).astype(int) for strip in (0, 1) for i in range(6)
    )
    assert seen[0, 0] == -1
    assert (seen[row, column] == expected).all() and seen.max() == 6


def test_what_lies_behind_a_camera_is_not_seen():
    frame = Frame(np.array([-40.0, -40.0]), np.array([140.0, 70.0]), 0.1)
    assert seen_by(np.full((11, 18), 100.0), frame, flight()).max() == 0


@given(st.integers(1, 100_000), st.floats(0.05, 20))
@example(81633, 20.0)
def test_the_work_is_bounded_however_many_views_there_are(views, shape):
    frame = overlap_frame(Frame(np.zeros(2), np.array([100.0, 100.0 * shape]), 1.0), views)
    width, height = frame.size
    assert 38 <= max(width, height) <= 162
    # Each side is rounded up to a whole pixel, which on a narrow map is much of its area
    assert (width - 1) * (height - 1) * views <= 1e7 or max(width, height) <= 42
