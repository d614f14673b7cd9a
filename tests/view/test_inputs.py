"""A view's inputs show it, and are neither of the test nor the photograph that was taken there."""

from __future__ import annotations

import numpy as np
import pytest

from aug3d_core.dataset.projection import ground_points, shows
from aug3d_core.dataset.scene import RENDERED, SPLITS
from aug3d_core.view import inputs
from aug3d_core.view.inputs import Candidates
from tests.toy_scene import toy_scene

TARGET = SPLITS.index("target")


@pytest.fixture(scope="module")
def candidates() -> Candidates:
    return Candidates.of(toy_scene(0, 64, 48))


@pytest.mark.parametrize("view", range(0, 36, 5))
def test_they_see_most_of_the_ground_in_view(candidates: Candidates, view: int) -> None:
    scene = candidates.scene
    chosen = candidates.chosen(scene.world_from_cam[view], scene.intrinsics[view], 3)
    assert 1 <= len(chosen) <= 3 and view not in chosen
    assert (scene.source[chosen] != RENDERED).all() and (scene.splits[chosen] != TARGET).all()
    ground, reached = ground_points(scene, view)
    seen = np.any([shows(scene, int(one), ground) for one in chosen], axis=0)
    assert seen[reached].mean() > 0.6


def test_a_photograph_is_an_input_beside_its_own_pose(candidates: Candidates) -> None:
    scene, pose = candidates.scene, candidates.scene.world_from_cam[8].copy()
    pose[0, 3] += 1.0
    assert 8 in candidates.chosen(pose, scene.intrinsics[8], 3)


def test_up_in_the_sky_there_are_none(candidates: Candidates) -> None:
    scene, pose = candidates.scene, candidates.scene.world_from_cam[8].copy()
    pose[:3, 1:3] *= -1  # looks up
    assert not len(candidates.chosen(pose, scene.intrinsics[8], 3))


def test_far_away_there_are_none(candidates: Candidates) -> None:
    scene, pose = candidates.scene, candidates.scene.world_from_cam[8].copy()
    pose[0, 3] += 1e4
    assert not len(candidates.chosen(pose, scene.intrinsics[8], 3))


def test_of_many_photographs_only_those_around_are_gone_through(monkeypatch: pytest.MonkeyPatch) -> None:
    all_of_them = Candidates.of(toy_scene(0, 64, 48))
    scene = all_of_them.scene
    wanted = [all_of_them.chosen(scene.world_from_cam[view], scene.intrinsics[view], 3) for view in range(0, 36, 5)]
    monkeypatch.setattr(inputs, "_AROUND", 12)
    for view, chosen in zip(range(0, 36, 5), wanted, strict=True):
        assert np.array_equal(all_of_them.chosen(scene.world_from_cam[view], scene.intrinsics[view], 3), chosen)
