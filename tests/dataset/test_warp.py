"""Rays of a target, and what its inputs show along them at twice its size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from aug3d_core.dataset.scene import FINER, Scene, no_fine_images
from aug3d_core.dataset.warp import Inputs, Target, fine_colours, on_device
from tests.toy_scene import toy_scene

CPU = torch.device("cpu")


@pytest.fixture(scope="module")
def scene() -> Scene:
    return toy_scene(0, 24, 16)


@pytest.mark.parametrize("window", [(0, 0, 24, 16), (5, 3, 8, 4)])
def test_finer_rays_are_those_of_a_finer_camera(scene: Scene, window: tuple[int, int, int, int]) -> None:
    finer = Target.of(scene, 7, window, CPU).finer()
    camera = replace(scene, intrinsics=FINER * scene.intrinsics)
    left, top, width, height = (FINER * edge for edge in window)
    exact = Target.of(camera, 7, (left, top, width, height), CPU)
    assert torch.allclose(finer.rays, exact.rays, atol=1e-5)
    assert torch.allclose(finer.rise, exact.rise, atol=1e-6)


def test_a_view_shows_itself_the_mean_of_its_parts(scene: Scene) -> None:
    view = np.array([3])
    target = Target.of(scene, 3, (0, 0, 24, 16), CPU)
    fine = on_device(scene.fine(view) / 255, CPU).movedim(-1, 1)
    heights = target.height_of(on_device(scene.scaffold[3], CPU))
    shown = fine_colours(target, Inputs.of(scene, 3, view, CPU), fine, heights)
    parts = scene.fine_images[3].reshape(16, FINER, 24, FINER, 3).mean(axis=(1, 3)) / 255
    assert np.abs(shown[0].movedim(0, -1).numpy() - parts).max() < 2e-3


def test_what_has_no_fine_image_is_enlarged_and_says_the_same(scene: Scene) -> None:
    bare = replace(scene, fine_images=no_fine_images(len(scene), (24, 16)))
    photograph, render = 3, len(scene) - 1
    assert np.array_equal(scene.fine(np.array([photograph]))[0], scene.fine_images[photograph])
    for view in (photograph, render):
        means = bare.fine(np.array([view]))[0].reshape(16, FINER, 24, FINER, 3).mean(axis=(1, 3))
        inner = np.s_[2:-2, 2:-2]
        smooth = np.abs(np.diff(scene.images[view].astype(float), axis=0)).max()
        assert np.abs(means - scene.images[view])[inner].max() < smooth
