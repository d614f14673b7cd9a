import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.domes.dome import directions, looking_at
from aug3d_core.geometry.transforms import centres, forward


@given(st.floats(5, 60), st.floats(1, 29), st.floats(-400, 400), st.floats(1, 360), st.integers(0, 99))
def test_directions_keep_to_their_sector(low, span, start, width, seed):
    unit = directions(50, (low, low + span), (start, start + width), np.random.default_rng(seed))
    np.testing.assert_allclose(np.linalg.norm(unit, axis=1), 1)
    elevation = np.degrees(np.arcsin(unit[:, 2]))
    assert (elevation >= low - 1e-9).all()
    assert (elevation <= low + span + 1e-9).all()
    turned = (np.degrees(np.arctan2(unit[:, 1], unit[:, 0])) - start + 1e-7) % 360
    assert (turned <= width + 1e-6).all()


def test_directions_are_uniform_by_area():
    unit = directions(100_000, (0, 90), (0, 360), np.random.default_rng(0))
    # On a hemisphere heights are uniform, and so a third of the area lies above sin(elevation) = 2/3
    assert abs((unit[:, 2] > 2 / 3).mean() - 1 / 3) < 0.005
    np.testing.assert_allclose(unit.mean(axis=0), [0, 0, 0.5], atol=0.01)


def test_cameras_look_at_the_centre_from_their_radius_with_the_horizon_level():
    rng = np.random.default_rng(1)
    centre, radius = np.array([10.0, -20.0, 3.0]), rng.uniform(5, 9, 11)
    cameras = looking_at(centre, directions(11, (30, 89), (0, 360), rng), radius)
    places = centres(cameras)
    np.testing.assert_allclose(np.linalg.norm(places - centre, axis=1), radius)
    np.testing.assert_allclose(places + radius[:, None] * forward(cameras), np.tile(centre, (11, 1)), atol=1e-9)
    np.testing.assert_allclose(cameras[:, 0, 2], 0, atol=1e-12)  # x, to the right, is level
    assert (cameras[:, 1, 2] < 0).all()  # y, down the image, goes down
    np.testing.assert_allclose(np.linalg.det(cameras[:, :3, :3]), 1)
