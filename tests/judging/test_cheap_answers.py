from dataclasses import replace

import numpy as np
import pytest

from aug3d_core.judging.cheap_answers import bilinear, cheap_answers, rank
from tests.toy_scene import EXTENT_M, ToyWorld, toy_scene


@pytest.fixture(scope="module")
def flat():
    """A world without boxes, where the ground is all there is."""
    texture = np.random.default_rng(0).uniform(0, 1, (32, 32, 16, 3))
    return toy_scene(0, 48, 36, world=ToyWorld(np.zeros((0, 5)), texture))


def test_on_flat_ground_the_homography_is_right_where_an_input_reaches(flat):
    target = int(flat.groups["test"][0, 0])
    answers = cheap_answers(flat, target, flat.groups["test"][0, 1:])
    wrong = np.abs(answers["ground_homography"].astype(int) - flat.images[target]).mean(axis=-1)
    mean = np.abs(answers["mean_colour"].astype(int) - flat.images[target]).mean(axis=-1)
    assert np.median(wrong) < 0.2 * np.median(mean)


def test_a_view_that_reaches_nothing_gives_the_mean_colour(flat):
    poses = flat.world_from_cam.copy()
    inputs = flat.groups["test"][0, 1:]
    poses[inputs, 0, 3] += 100 * EXTENT_M
    answers = cheap_answers(replace(flat, world_from_cam=poses), int(flat.groups["test"][0, 0]), inputs)
    assert np.array_equal(answers["ground_homography"], answers["mean_colour"])


def test_holes_of_the_mesh_show_the_mean_colour(flat):
    target, inputs = int(flat.groups["test"][0, 0]), flat.groups["test"][0, 1:]
    bare = replace(flat, baseline_alpha=np.zeros_like(flat.baseline_alpha))
    answers = cheap_answers(bare, target, inputs)
    assert np.array_equal(answers["mesh_render"], answers["mean_colour"])


def test_the_same_view_is_the_nearest_input(flat):
    target = int(flat.groups["test"][0, 0])
    assert rank(flat, target, np.array([3, 9, target, 20]))[0] == target


def test_bilinear_is_exact_at_pixel_centres_and_half_way():
    image = np.random.default_rng(0).integers(0, 256, (7, 11, 3), dtype=np.uint8)
    assert np.array_equal(bilinear(image, np.array([[4.5, 2.5]]))[0], image[2, 4])
    assert np.allclose(bilinear(image, np.array([[5.0, 2.5]]))[0], image[2, 4:6].mean(axis=0))
    assert np.array_equal(bilinear(image, np.array([[-3.0, 99.0]]))[0], image[6, 0])


def test_what_is_masked_in_the_inputs_is_in_no_answer_that_can_do_without(flat):
    """As they are packed, nothing of it is left; so here it is put back, in a colour that nothing else has."""
    target, inputs = int(flat.groups["test"][0, 0]), flat.groups["test"][0, 1:4]
    images, fine, alpha = flat.images.copy(), flat.fine_images.copy(), flat.alpha.copy()
    images[inputs[0], 5:30, 5:30], alpha[inputs[0], 5:30, 5:30] = (255, 0, 255), 0
    fine[inputs[0], 10:60, 10:60] = (255, 0, 255)
    bright = replace(flat, images=images, fine_images=fine)
    answers, bare = (cheap_answers(one, target, inputs) for one in (replace(bright, alpha=alpha), bright))
    for name in ("ground_homography", "guided_blend", "plane_sweep"):
        green, masked = (one[name].astype(int)[..., 1] for one in (answers, bare))
        assert (masked < 5).sum() > 20 * max((green < 5).sum(), 1), name
    rest = np.concatenate([flat.images[inputs[1:]].reshape(-1, 3), flat.images[inputs[0]][alpha[inputs[0]] > 0]])
    np.testing.assert_array_equal(answers["mean_colour"][0, 0], np.rint(rest.mean(axis=0)))
