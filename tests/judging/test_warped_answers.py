"""Answers that move pixels by geometry: right where the geometry is, and blind to the target."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aug3d_core.dataset.projection import ground_points, shows
from aug3d_core.dataset.scene import no_fine_images
from aug3d_core.judging.cheap_answers import ground_homography
from aug3d_core.judging.scores import psnr
from aug3d_core.judging.warped_answers import guided_blend, plane_sweep
from tests.toy_scene import toy_scene


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, 64, 48)


def members(scene):
    target, *inputs = scene.groups["test"][0]
    return int(target), np.array(inputs[:4])


def test_true_depth_moves_pixels_to_their_place(scene):
    target, inputs = members(scene)
    bare = replace(scene, baseline_alpha=np.zeros_like(scene.baseline_alpha))
    guided, flat = (answer(bare, target, inputs) for answer in (guided_blend, ground_homography))
    assert psnr(scene.images[target], guided) > psnr(scene.images[target], flat) + 2


def test_the_mesh_fills_what_no_input_sees(scene):
    target, inputs = members(scene)
    poses = scene.world_from_cam.copy()
    poses[inputs, 0, 3] += 1e4
    answer = guided_blend(replace(scene, world_from_cam=poses), target, inputs)
    row = int(np.flatnonzero(scene.baseline_view == target)[0])
    assert np.array_equal(answer, scene.baseline_images[row])


def test_an_input_behind_a_wall_is_not_used(scene):
    """The scaffold of an input that is blind sees something just before its lens."""
    target, inputs = members(scene)
    scaffold, images, fine = scene.scaffold.copy(), scene.images.copy(), scene.fine_images.copy()
    scaffold[inputs[0]], images[inputs[0]], fine[inputs[0]] = 1.0, 0, 1
    with_wall = guided_blend(replace(scene, scaffold=scaffold, images=images, fine_images=fine), target, inputs)
    without = guided_blend(scene, target, inputs[1:])
    assert np.abs(with_wall.astype(int) - without).mean() < 1


def test_a_sweep_finds_boxes_without_being_told(scene):
    target, inputs = members(scene)
    swept, flat = (answer(scene, target, inputs) for answer in (plane_sweep, ground_homography))
    assert psnr(scene.images[target], swept) > psnr(scene.images[target], flat)


def test_a_sweep_lays_what_a_single_input_sees_on_the_ground(scene):
    """Two inputs that look elsewhere: nothing can be compared."""
    target, inputs = members(scene)
    poses = scene.world_from_cam.copy()
    poses[inputs[1:3], 0, 3] += 1e4
    alone = replace(scene, world_from_cam=poses)
    swept, flat = (answer(alone, target, inputs[:3]).astype(int) for answer in (plane_sweep, ground_homography))
    points, _ = ground_points(alone, target)
    seen = shows(alone, int(inputs[0]), points).reshape(48, 64)
    assert seen.mean() > 0.2
    assert np.median(np.abs(swept - flat)[seen]) <= 1


@pytest.mark.parametrize("answer", [plane_sweep, guided_blend])
def test_the_target_is_not_looked_at(scene, answer):
    target, inputs = members(scene)
    images, fine = scene.images.copy(), scene.fine_images.copy()
    images[target], fine[target] = 0, 0
    unseen = replace(scene, images=images, fine_images=fine)
    assert np.array_equal(answer(scene, target, inputs), answer(unseen, target, inputs))


def test_fine_images_bring_it_nearer_to_the_truth(scene):
    coarse = replace(scene, fine_images=no_fine_images(len(scene), (64, 48)))
    for target, *inputs in scene.groups["test"]:
        truth, given = scene.images[target], np.array(inputs[:4])
        assert psnr(truth, guided_blend(scene, target, given)) > psnr(truth, guided_blend(coarse, target, given))


def test_inputs_far_away_are_no_error(scene):
    target, inputs = members(scene)
    poses = scene.world_from_cam.copy()
    poses[inputs, 0, 3] += 1e4
    assert plane_sweep(replace(scene, world_from_cam=poses), target, inputs).shape == (48, 64, 3)
