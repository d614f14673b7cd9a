"""The flight of a preview keeps over the photographs, and a model that is not surely better is doubted."""

import numpy as np
import pytest

from aug3d_core.novel.preview import across, doubts_of, foreseen, usual_rotation
from tests.toy_scene import ALTITUDE_M, toy_scene


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, 48, 36)


def test_the_flight_is_straight_level_and_over_the_photographs(scene):
    poses = across(scene, 9)
    eyes = poses[:, :3, 3]
    steps = np.diff(eyes, axis=0)
    assert np.allclose(steps, steps[0])
    assert np.abs(scene.slab.height(eyes) - ALTITUDE_M).max() < 6
    low, high = scene.world_from_cam[:, :2, 3].min(axis=0), scene.world_from_cam[:, :2, 3].max(axis=0)
    assert ((eyes[:, :2] > low) & (eyes[:, :2] < high)).all()
    assert np.allclose(poses[:, :3, :3], poses[0, :3, :3])


def test_its_camera_is_turned_as_one_of_the_photographs(scene):
    usual = usual_rotation(scene)
    assert any(np.array_equal(usual, pose[:3, :3]) for pose in scene.world_from_cam)


def test_a_model_that_is_surely_better_is_not_doubted():
    scores = np.array([[25.0, 21.0, 22.0], [24.0, 20.0, 22.5], [26.0, 22.0, 23.0], [23.0, 19.0, 20.0]])
    figures = foreseen(scores)
    assert figures["over_best_cheap_db"] == pytest.approx(2.625)
    assert 0 < figures["over_best_cheap_low_db"] < figures["over_best_cheap_db"]
    assert doubts_of(figures) == []


def test_a_model_that_may_be_worse_is_doubted_with_its_figures():
    """It is better on average, and below the sweep on half of the photographs."""
    figures = foreseen(np.array([[25.0, 15.0, 20.0], [20.0, 15.0, 21.0], [24.0, 16.0, 21.0], [20.0, 15.0, 23.0]]))
    assert figures["over_best_cheap_db"] > 0 >= figures["over_best_cheap_low_db"]
    (doubt,) = doubts_of(figures)
    assert f"{figures['over_best_cheap_db']:+.2f} dB" in doubt


def test_the_lead_is_over_the_better_cheap_answer():
    assert foreseen(np.array([[20.0, 19.0, 10.0]] * 3))["over_best_cheap_db"] == pytest.approx(1.0)
    assert foreseen(np.array([[20.0, 10.0, 18.0]] * 3))["over_best_cheap_db"] == pytest.approx(2.0)
