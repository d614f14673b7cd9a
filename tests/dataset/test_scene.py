from dataclasses import replace

import numpy as np
import pytest
from toy_scene import toy_scene

from aug3d_core.dataset.leaks import leaks, mesh_leaks
from aug3d_core.dataset.scene import SPLITS, check
from aug3d_core.errors import InputError


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, 12, 8)


def test_near_beyond_far_is_refused_with_the_view(scene):
    near_far = scene.near_far.copy()
    near_far[5] = near_far[5, ::-1]
    with pytest.raises(InputError, match="view 5 has near"):
        check(replace(scene, near_far=near_far), "scene.zarr")


def test_a_group_with_a_view_that_is_not_there_is_refused(scene):
    groups = scene.groups | {"real": scene.groups["real"] + len(scene)}
    with pytest.raises(InputError, match="groups/real"):
        check(replace(scene, groups=groups), "scene.zarr")


def test_a_target_without_a_mesh_render_is_refused(scene):
    with pytest.raises(InputError, match=f"test view {scene.baseline_view[-1]} has no mesh render"):
        check(replace(scene, baseline_view=scene.baseline_view[:-1]), "scene.zarr")


def test_an_honest_scene_does_not_leak(scene):
    assert leaks(scene) == []


@pytest.mark.parametrize("role", ["gap", "support", "target"])
def test_a_test_photo_in_a_training_group_leaks(scene, role):
    view = int(np.flatnonzero(scene.splits == SPLITS.index(role))[0])
    real = scene.groups["real"].copy()
    real[2, 1] = view
    assert leaks(replace(scene, groups=scene.groups | {"real": real})) == [
        f"training group set real holds {role} view {view}"
    ]


def test_a_target_among_the_inputs_of_another_leaks(scene):
    test = scene.groups["test"].copy()
    test[0, 1] = test[1, 0]
    assert any("test input" in leak for leak in leaks(replace(scene, groups=scene.groups | {"test": test})))


def photos(scene, *roles: str) -> list[int]:
    return [int(p) for p, s in zip(scene.photo_id, scene.splits, strict=True) if p >= 0 and SPLITS[s] in roles]


def test_meshes_made_of_what_they_may_do_not_leak(scene):
    sources = {"mesh": photos(scene, "train"), "baseline": photos(scene, "train", "gap", "support")}
    assert mesh_leaks(scene, sources) == []


@pytest.mark.parametrize("role", ["gap", "support", "target"])
def test_a_test_photo_in_the_mesh_of_train_photos_leaks(scene, role):
    wrong = photos(scene, role)[0]
    sources = {"mesh": [*photos(scene, "train"), wrong], "baseline": []}
    assert mesh_leaks(scene, sources) == [f"the mesh of train photos was made of {role} photo {wrong}"]


def test_a_target_in_the_baseline_mesh_or_a_photo_nobody_knows_leaks(scene):
    target = photos(scene, "target")[0]
    found = mesh_leaks(scene, {"mesh": [], "baseline": [target, 10**6]})
    assert [sentence.rpartition(" of ")[2] for sentence in found] == [f"target photo {target}", "unknown photo 1000000"]
