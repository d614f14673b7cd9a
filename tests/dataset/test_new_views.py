"""A scaffold seen from elsewhere: where the inputs' scaffolds are exact, so is it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aug3d_core.dataset.new_views import with_scaffold
from aug3d_core.dataset.scene import Scene
from tests.toy_scene import toy_scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return toy_scene(0, 48, 36)  # its scaffold is exact at every view


def test_a_view_sees_its_own_scaffold_again(scene: Scene) -> None:
    found = with_scaffold(scene, np.array([40]), np.array([40]))
    off = np.abs(found.scaffold[40].astype(float) - scene.scaffold[40])
    assert np.median(off) < 1e-2 * scene.scale and (found.scaffold[40] > 0).mean() > 0.98
    np.testing.assert_array_equal(np.delete(found.scaffold, 40, axis=0), np.delete(scene.scaffold, 40, axis=0))


def test_what_other_views_show_lies_where_it_is(scene: Scene) -> None:
    target, *inputs = scene.groups["test"][0]
    found = with_scaffold(scene, np.array([target]), np.array(inputs)).scaffold[target].astype(float)
    truth, known = scene.scaffold[target].astype(float), found > 0
    assert known.mean() > 0.5
    off = np.abs(found - truth)[known] / scene.scale
    assert np.median(off) < 0.005 and np.quantile(off, 0.9) < 0.15, "edges are a pixel wide"


def test_inputs_without_a_scaffold_give_none(scene: Scene) -> None:
    bare = replace(scene, scaffold=np.zeros_like(scene.scaffold))
    assert not with_scaffold(bare, np.array([40]), np.array([38, 41])).scaffold[:].any()
