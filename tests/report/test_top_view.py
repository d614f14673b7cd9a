import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.report.top_view import Frame, frame_of, from_above

FRAME = Frame(np.array([-10.0, 0.0]), np.array([10.0, 10.0]), 2.0)


def test_the_north_is_up_and_the_east_is_right():
    assert FRAME.size == (40, 20)
    places = FRAME.place(np.array([[-10.0, 10.0], [10.0, 0.0], [0.0, 5.0]]))
    assert places.tolist() == [[0, 0], [40, 20], [20, 10]]


def test_another_size_shows_the_same():
    small = FRAME.scaled(10)
    assert small.size == (10, 5)
    assert np.allclose(small.place(np.array([3.0, 4.0])) * 4, FRAME.place(np.array([3.0, 4.0])))


@given(st.integers(0, 2**32 - 1))
def test_every_camera_is_on_the_map_however_far_the_points_are(seed):
    rng = np.random.default_rng(seed)
    cameras, points = rng.normal(0, 10, (7, 2)), rng.normal(50, 1000, (60, 2))
    frame = frame_of(points, cameras, 500)
    places, size = frame.place(cameras), np.array(frame.size)
    assert ((places >= 0) & (places <= size)).all() and 499 <= size.max() <= 501
    extent = np.ptp(cameras, axis=0).max()
    assert (np.ptp(np.stack([frame.low, frame.high]), axis=0) <= 2.3 * extent).all()


def test_a_single_camera_without_points_has_a_map():
    assert frame_of(np.zeros((0, 2)), np.array([[3.0, 4.0]]), 100).size == (100, 100)


def test_the_highest_point_of_a_pixel_is_seen():
    xyz = np.array([[0.1, 5.1, 3.0], [0.1, 5.1, 9.0], [0.1, 5.1, 6.0], [50, 50, 1]])
    rgb = np.array([[1, 1, 1], [2, 2, 2], [3, 3, 3], [4, 4, 4]], np.uint8)
    colours, heights = from_above(xyz, rgb, FRAME)
    column, row = FRAME.place(xyz[0, :2]).astype(int)
    assert colours[row, column].tolist() == [2, 2, 2, 255] and heights[row, column] == 9
    assert np.isfinite(heights).sum() == 1 and (colours[..., 3] > 0).sum() == 1


def test_gaps_between_points_are_filled_from_their_neighbours():
    x, y = np.meshgrid(np.arange(-9.75, 10, 1), np.arange(0.25, 10, 0.5))  # every second column
    xyz = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 7.0)])
    colours, heights = from_above(xyz, np.full((len(xyz), 3), 80, np.uint8), FRAME)
    assert np.isfinite(heights[1:-1, 1:-1]).all() and np.nanmax(np.abs(heights - 7)) < 1e-9
    assert set(np.unique(colours[1:-1, 1:-1, :3])) == {80}
