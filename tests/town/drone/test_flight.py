import numpy as np
import pytest

from aug3d_core.geometry.transforms import centres, forward
from aug3d_core.town.config import PRESETS, TownConfig
from aug3d_core.town.drone import flight
from aug3d_core.town.drone.flight import plan_flight
from aug3d_core.town.drone.paths import PATHS


@pytest.fixture
def steady(monkeypatch):
    monkeypatch.setattr(flight, "_UNSTEADY_M", 0.0)
    monkeypatch.setattr(flight, "_UNSTEADY_DEG", (0.0, 0.0, 0.0))


def test_the_demo_takes_about_sixty_photographs():
    assert 55 <= len(plan_flight(PRESETS["tiny"], np.random.default_rng(0))) <= 62


def test_overlaps_are_as_asked(steady):
    config = TownConfig(forward_overlap=0.8, side_overlap=0.6)
    views = plan_flight(config, np.random.default_rng(0))
    at = centres(views.cam_from_world)
    footprint = config.altitude_m * np.array([config.width_px, config.height_px]) / config.focal_px
    first_line = np.isclose(at[:, 1], at[0, 1])
    steps = np.diff(at[first_line][:, 0])
    np.testing.assert_allclose(1 - steps / footprint[1], 0.8, atol=1e-9)
    lines = np.unique(np.round(at[:, 1], 6))
    np.testing.assert_allclose(1 - np.diff(lines) / footprint[0], 0.6, atol=1e-9)


def test_lines_alternate_and_cameras_look_ahead_and_down(steady):
    config = TownConfig(tilt_deg=20)
    views = plan_flight(config, np.random.default_rng(0))
    at, look = centres(views.cam_from_world), forward(views.cam_from_world)
    np.testing.assert_allclose(look[:, 2], -np.cos(np.radians(20)))
    same_line = np.isclose(at[1:, 1], at[:-1, 1])
    np.testing.assert_array_equal(np.sign(np.diff(at[:, 0]))[same_line], np.sign(look[:-1, 0])[same_line])
    assert len(set(np.sign(look[:, 0]))) == 2
    # What is ahead is at the top of the picture: y of the camera runs against the heading.
    assert (views.cam_from_world[:, 1, 0] * look[:, 0] < 0).all()
    # What the photographs show is centred on the town.
    ground = at[:, :2] + look[:, :2] / -look[:, 2:] * at[:, 2:]
    np.testing.assert_allclose(ground.mean(axis=0), 0, atol=1e-9)


def test_poses_are_rigid_and_repeat():
    config = TownConfig()
    views, again = (plan_flight(config, np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(views.cam_from_world, again.cam_from_world)
    rotation = views.cam_from_world[:, :, :3]
    np.testing.assert_allclose(
        rotation @ np.swapaxes(rotation, 1, 2), np.tile(np.eye(3), (len(views), 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(rotation), 1)
    assert views.photo_id.tolist() == list(range(len(views)))


def test_a_flight_may_end_early():
    whole, short = (plan_flight(TownConfig(max_photos=n), np.random.default_rng(5)) for n in (None, 7))
    assert len(short) == 7
    np.testing.assert_array_equal(short.cam_from_world, whole.cam_from_world[:7])


@pytest.mark.parametrize("path", PATHS)
def test_every_path_makes_rigid_cameras_that_look_down(path):
    views = plan_flight(TownConfig(path=path), np.random.default_rng(5))
    rotation = views.cam_from_world[:, :, :3]
    np.testing.assert_allclose(np.linalg.det(rotation), 1)
    assert (forward(views.cam_from_world)[:, 2] < -0.7).all()
