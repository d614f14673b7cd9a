from dataclasses import replace

import numpy as np
import pytest

from aug3d_core.dataset.batches import check_groups, draw
from aug3d_core.dataset.scene import RENDERED
from aug3d_core.heads.pixelnerf.config import TrainingConfig
from aug3d_core.judging.cheap_answers import project
from aug3d_core.run.errors import InputError
from tests.toy_scene import toy_scene

CONFIG = TrainingConfig(groups_per_step=3, rays_per_group=20)


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, 12, 8)


def drawn(scene, config, count=30):
    return [draw(scene, config, np.random.default_rng(seed)) for seed in range(count)]


def test_a_target_is_never_among_its_inputs(scene):
    for batch in drawn(scene, CONFIG):
        for g, inputs in enumerate(batch.inputs):
            eyes = scene.world_from_cam[inputs, :3, 3]
            origins = batch.rays.origins[g * 20 : (g + 1) * 20]
            assert np.linalg.norm(origins[:, None] - eyes, axis=-1).min() > 1e-6


def test_the_truth_is_the_pixel_that_the_ray_goes_through(scene):
    batch = drawn(scene, CONFIG, 1)[0]
    points = batch.rays.origins + batch.rays.far[:, None] * batch.rays.directions
    for r, origin in enumerate(batch.rays.origins):
        view = int(np.argmin(np.linalg.norm(scene.world_from_cam[:, :3, 3] - origin, axis=1)))
        xy_px, _ = project(scene, view, points[r : r + 1])
        x, y = np.floor(xy_px[0] + 1e-6).astype(int)
        assert np.allclose(scene.images[view, y, x] / 255, batch.colour[r])


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_rendered_groups_are_drawn_at_their_share(scene, share):
    config = CONFIG.model_copy(update={"rendered_share": share})
    inputs = np.concatenate([batch.inputs for batch in drawn(scene, config, 200)])
    assert (scene.source[inputs[:, 0]] == RENDERED).mean() == pytest.approx(share, abs=0.06)


def test_without_renders_real_groups_fill_in(scene):
    bare = replace(scene, groups=scene.groups | {"rendered": np.zeros((0, 6), np.int32)})
    for batch in drawn(bare, CONFIG):
        assert (scene.source[batch.inputs] != RENDERED).all()


def test_only_training_views_are_drawn(scene):
    used = np.unique(np.concatenate([batch.inputs for batch in drawn(scene, CONFIG, 100)]))
    assert (scene.splits[used] == 0).all()


def test_holes_of_a_render_weigh_nothing(scene):
    batch = drawn(replace(scene, alpha=np.zeros_like(scene.alpha)), CONFIG, 1)[0]
    assert (batch.weight == 0).all()


def test_more_inputs_than_members_is_refused(scene):
    with pytest.raises(InputError, match="input_views = 6 leaves no target in the 6 members of groups/real"):
        check_groups(scene, CONFIG.model_copy(update={"input_views": 6}))


def test_no_group_at_all_is_refused(scene):
    none = np.zeros((0, 6), np.int32)
    with pytest.raises(InputError, match="no training group"):
        check_groups(replace(scene, groups=scene.groups | {"real": none, "rendered": none}), CONFIG)
