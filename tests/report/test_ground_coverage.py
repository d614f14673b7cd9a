from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Views
from aug3d_core.report.ground_coverage import enclosed, overlap_frame, seen_by
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


MAP = Frame(np.array([-80.0, -80.0]), np.array([180.0, 110.0]), 1.0)


def looking(aims: np.ndarray, back: float) -> Views:
    """Return photographs that look at places of level ground from 60 m above, and so far south of them."""
    level = np.column_stack([aims, np.zeros(len(aims))])
    poses = np.stack([look_at(aim + np.array([0, -back, 60.0]), aim) for aim in level])
    count = len(aims)
    return Views(np.arange(count), poses, np.tile([600.0, 600, 300, 200], (count, 1)), np.tile([600, 400], (count, 1)))


@pytest.mark.parametrize("back", [0.001, 60.0])
def test_a_flight_encloses_what_its_cameras_look_at_and_a_quarter_of_a_picture_about_it(back):
    aims = np.array([[0.0, 0], [100, 0], [100, 30], [0, 30], [50, 15]])
    inside = enclosed(np.zeros((190, 260)), MAP, looking(aims, back))
    row, column = np.indices(inside.shape)
    x, y = column - 80 + 0.5, 110 - row - 0.5
    away = np.hypot(np.maximum(np.abs(x - 50) - 50, 0), np.maximum(np.abs(y - 15) - 15, 0))
    quarter = 10.0  # of the 40 m that the shorter side of a picture shows
    assert inside[away < quarter - 2].all() and not inside[away > quarter + 2].any()


def test_a_line_encloses_what_lies_about_it_and_who_looks_at_the_horizon_nothing():
    along = looking(np.array([[0.0, 0], [40, 0], [80, 0]]), 0.001)
    assert 0 < enclosed(np.zeros((190, 260)), MAP, along).sum() < 3 * 21**2
    ahead = np.array([0.0, 90, 0])
    level = np.stack([look_at(eye, eye + ahead) for eye in np.array([[0.0, 0, 60], [40, 0, 60], [80, 0, 60]])])
    assert not enclosed(np.zeros((190, 260)), MAP, replace(along, cam_from_world=level)).any()


@given(st.integers(1, 100_000), st.floats(0.05, 20))
@example(81633, 20.0)
def test_the_work_is_bounded_however_many_views_there_are(views, shape):
    frame = overlap_frame(Frame(np.zeros(2), np.array([100.0, 100.0 * shape]), 1.0), views)
    width, height = frame.size
    assert 38 <= max(width, height) <= 162
    # Each side is rounded up to a whole pixel, which on a narrow map is much of its area
    assert (width - 1) * (height - 1) * views <= 1e7 or max(width, height) <= 42
