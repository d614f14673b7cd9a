"""Answers are made from the photographs that see most of the target."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aug3d_core.dataset.scene import Scene
from aug3d_core.judging.inputs import chosen_inputs
from tests.toy_scene import toy_scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return toy_scene(0, 48, 36)


def test_without_a_scaffold_the_first_are_taken(scene: Scene) -> None:
    target, *support = scene.groups["test"][0]
    bare = replace(scene, scaffold=np.zeros_like(scene.scaffold))
    assert chosen_inputs(bare, target, np.array(support), 3).tolist() == support[:3]


def test_a_view_that_sees_everything_is_taken_wherever_it_stands_in_the_group(scene: Scene) -> None:
    """The target itself sees all of the target, from the same place."""
    target, *support = scene.groups["test"][0]
    for place in range(len(support)):
        candidates = np.insert(np.array(support), place, target)
        assert target in chosen_inputs(scene, target, candidates, 1)


def test_each_is_taken_once_in_the_order_that_was_given(scene: Scene) -> None:
    target, *support = scene.groups["test"][0]
    for count in range(1, len(support) + 2):
        found = chosen_inputs(scene, target, np.array(support), count)
        assert len(found) == min(count, len(support))
        places = [support.index(view) for view in found]
        assert places == sorted(set(places))


def test_a_view_that_looks_elsewhere_comes_last(scene: Scene) -> None:
    target, *support = scene.groups["test"][0]
    away = scene.world_from_cam.copy()
    away[support[0], :3, 3] += 1000 * scene.scale
    found = chosen_inputs(replace(scene, world_from_cam=away), target, np.array(support), len(support) - 1)
    assert support[0] not in found
