from dataclasses import replace

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
