import hashlib
from dataclasses import replace

import numpy as np
import pytest

from aug3d_core.judging.conventions import conventions, digest, held_out_digest
from tests.toy_scene import toy_scene


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, 12, 8)


def test_the_same_rules_have_the_same_digest(scene):
    assert digest(conventions(scene)) == digest(conventions(toy_scene(1, 12, 8)))


@pytest.mark.parametrize("changed", ["photographs", "size"])
def test_other_rules_have_another(scene, changed):
    other = (
        toy_scene(0, 16, 8)
        if changed == "size"
        else replace(scene, attributes={"conventions": {"images": "linear light"}})
    )
    assert digest(conventions(scene)) != digest(conventions(other))


def test_the_same_test_photographs_are_known_whatever_their_order_and_their_inputs(scene):
    test = scene.groups["test"]
    turned = replace(scene, groups=scene.groups | {"test": test[::-1, :4]})
    assert held_out_digest(turned) == held_out_digest(scene)


@pytest.mark.parametrize("fewer", [True, False])
def test_other_test_photographs_are_told_apart(scene, fewer):
    images = scene.images.copy()
    images[scene.groups["test"][0, 0], 0, 0, 0] ^= 1
    few = replace(scene, groups=scene.groups | {"test": scene.groups["test"][1:]})
    assert held_out_digest(few if fewer else replace(scene, images=images)) != held_out_digest(scene)


def masked(scene, view, seed):
    """Return the scene with a part of a view masked, in which anything stands."""
    alpha, images = scene.alpha.copy(), scene.images.copy()
    alpha[view, 2:6, 3:9] = 0
    images[view, 2:6, 3:9] = np.random.default_rng(seed).integers(0, 256, (4, 6, 3))
    return replace(scene, alpha=alpha, images=images)


def test_masks_of_test_photographs_are_part_of_the_rules_and_of_what_is_held_out(scene):
    target, other = int(scene.groups["test"][0, 0]), int(scene.groups["real"][0, 0])
    assert digest(conventions(masked(scene, target, 0))) != digest(conventions(scene))
    assert digest(conventions(masked(scene, other, 0))) == digest(conventions(scene))
    assert held_out_digest(masked(scene, target, 0)) != held_out_digest(scene)
    assert held_out_digest(masked(scene, target, 0)) == held_out_digest(masked(scene, target, 1))


def test_without_masks_the_digests_are_what_they_were(scene):
    """Results of before there were masks stay comparable."""
    assert digest(conventions(scene)) == "07b01627394c"
    each = sorted(hashlib.sha256(scene.images[v].tobytes()).hexdigest() for v in np.unique(scene.groups["test"][:, 0]))
    assert held_out_digest(scene) == hashlib.sha256("".join(each).encode()).hexdigest()[:12]
