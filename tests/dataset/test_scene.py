from dataclasses import replace

import pytest

from aug3d_core.dataset.scene import BASELINE_ARRAYS, check
from aug3d_core.run.errors import InputError
from tests.toy_scene import toy_scene


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


def test_fine_images_of_another_size_are_refused(scene):
    with pytest.raises(InputError, match=r"fine_images has the shape \(.*, 8, 12, 3\), not \(.*, 16, 24, 3\)"):
        check(replace(scene, fine_images=scene.images), "scene.zarr")


def test_a_target_without_a_mesh_render_is_refused(scene):
    with pytest.raises(InputError, match=f"test view {scene.baseline_view[-1]} has no mesh render"):
        check(replace(scene, **{name: getattr(scene, name)[:-1] for name in BASELINE_ARRAYS}), "scene.zarr")
