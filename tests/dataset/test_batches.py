from dataclasses import replace

import numpy as np
import pytest

from aug3d_core.dataset.batches import Wanted, check_groups, draw, pixel_colours
from aug3d_core.dataset.scene import RENDERED
from aug3d_core.run.errors import InputError
from tests.toy_scene import toy_scene

WANTED = Wanted(groups=3, input_views=3, rendered_share=0.5, pixels=20)


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, 12, 8)


def drawn(scenes, wanted=WANTED, count=30):
    return [group for seed in range(count) for group in draw(scenes, wanted, np.random.default_rng(seed))]


def test_inputs_and_targets_are_all_members_of_a_group_and_none_twice(scene):
    known = {tuple(sorted(members)) for name in ("real", "rendered") for members in scene.groups[name].tolist()}
    for group in drawn([scene]):
        assert tuple(sorted([*group.inputs, *group.targets])) in known
        assert len(group.inputs) == 3


def test_pixels_are_of_targets_and_within_their_images(scene):
    for group in drawn([scene]):
        view, x, y = group.pixels.T
        assert set(view) <= set(group.targets)
        assert x.min() >= 0 and x.max() < 12 and y.min() >= 0 and y.max() < 8


def test_whole_images_are_the_same_groups_without_pixels(scene):
    whole = draw([scene], replace(WANTED, groups=1, pixels=None), np.random.default_rng(0))[0]
    some = draw([scene], replace(WANTED, groups=1), np.random.default_rng(0))[0]
    assert whole.pixels is None
    assert np.array_equal(whole.inputs, some.inputs) and np.array_equal(whole.targets, some.targets)


def test_the_colour_is_that_of_the_pixel(scene):
    colours, weight = pixel_colours(scene, np.array([[3, 11, 0], [7, 2, 5]]))
    assert np.array_equal(colours * 255, scene.images[[3, 7], [0, 5], [11, 2]])
    assert (weight == 1).all()


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_rendered_groups_are_drawn_at_their_share(scene, share):
    groups = drawn([scene], replace(WANTED, rendered_share=share), 200)
    assert np.mean([scene.source[group.inputs[0]] == RENDERED for group in groups]) == pytest.approx(share, abs=0.06)


def test_scenes_are_drawn_alike_however_large(scene):
    small = replace(scene, groups=scene.groups | {"real": scene.groups["real"][:2]})
    groups = drawn([scene, small, scene], count=300)
    assert np.bincount([group.scene for group in groups]) / len(groups) == pytest.approx(1 / 3, abs=0.05)


def test_scenes_of_other_sizes_have_pixels_of_their_own(scene):
    large = toy_scene(0, 48, 32)
    groups = drawn([scene, large])
    assert max(group.pixels[:, 1].max() for group in groups if group.scene == 0) == 11
    assert max(group.pixels[:, 1].max() for group in groups if group.scene == 1) > 40


def test_without_renders_real_groups_fill_in(scene):
    bare = replace(scene, groups=scene.groups | {"rendered": np.zeros((0, 6), np.int32)})
    assert all((scene.source[group.inputs] != RENDERED).all() for group in drawn([bare]))


def test_only_training_views_are_drawn(scene):
    used = np.unique(np.concatenate([[*group.inputs, *group.targets] for group in drawn([scene], count=100)]))
    assert (scene.splits[used] == 0).all()


def test_holes_of_a_render_weigh_nothing(scene):
    holes = replace(scene, alpha=np.zeros_like(scene.alpha))
    assert (pixel_colours(holes, drawn([holes], count=1)[0].pixels)[1] == 0).all()


def test_groups_smaller_than_wanted_give_all_but_one(scene):
    few = replace(scene, groups=scene.groups | {"real": scene.groups["real"][:, :3]})
    for scenes in ([scene], [scene, few]):
        check_groups(scenes, replace(WANTED, input_views=9))
        found = draw(scenes, replace(WANTED, input_views=9, groups=30), np.random.default_rng(0))
        for number in range(2):
            assert len({len(group.inputs) for group in found if group.scene == number}) <= 1, "they stand in one array"
        assert all(len(group.targets) for group in found)


def test_groups_of_one_view_are_refused(scene):
    lone = replace(scene, groups=scene.groups | {"real": scene.groups["real"][:, :1]})
    with pytest.raises(InputError, match="groups/real has groups of one view"):
        check_groups([lone], WANTED)


def test_no_group_at_all_is_refused(scene):
    none = np.zeros((0, 6), np.int32)
    with pytest.raises(InputError, match="no training group"):
        check_groups([scene, replace(scene, groups=scene.groups | {"real": none, "rendered": none})], WANTED)
