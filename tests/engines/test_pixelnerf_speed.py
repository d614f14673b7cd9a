"""What `aug3d bench nerf` measures: both networks do the same work."""

from pathlib import Path

import numpy as np
import pytest

from aug3d_core.bench.nerf import paper, speed_figures
from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.rays import view_rays
from aug3d_core.dataset.writer import write
from aug3d_core.heads.pixelnerf import speed
from aug3d_core.heads.pixelnerf.speed_job import FAST, PLAIN, SpeedJob
from tests.toy_scene import toy_scene

LITTLE = paper({"hidden": 16, "coarse_samples": 4, "fine_samples": 2, "depth_samples": 2}).model_copy(
    update={"rays_per_group": 16}
)


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, 24, 16)


@pytest.fixture(scope="module")
def packed(scene, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("dataset") / SCENE_ZARR
    write(scene, path, shard_views=64)
    return path


def test_a_cropped_view_shows_the_same_along_the_same_rays(scene):
    part = speed.cropped(scene, 8)
    whole, some = view_rays(scene, 3, True), view_rays(part, 3, True)
    shape = (16, 24, 3)
    assert np.allclose(whole.directions.reshape(shape)[4:12, 8:16].reshape(-1, 3), some.directions)
    assert np.array_equal(scene.images[3, 4:12, 8:16], part.images[3])


def test_views_too_small_to_crop_are_named(scene):
    with pytest.raises(AssertionError, match="24 x 16 px are smaller than 64 px"):
        speed.cropped(scene, 64)


def test_both_networks_train_and_render_the_same(scene, packed):
    job = SpeedJob(scene=packed, config=LITTLE, side_px=16, repeats=2)
    told = speed.measure(speed.cropped(scene, 16), job)
    assert (told.train_rays, told.render_rays) == (16, 16 * 16)
    assert told.train_seconds.keys() == told.render_seconds.keys() == {FAST, PLAIN}
    assert all(len(seconds) == 2 and min(seconds) > 0 for seconds in told.train_seconds.values())
    assert told.output_difference < 1e-5
    assert told.gradient_difference < 1e-2


def test_one_network_alone_tells_its_memory(scene, packed):
    told = speed.measure(scene, SpeedJob(scene=packed, config=LITTLE, side_px=16, repeats=1, memory_of=PLAIN))
    assert told.train_seconds.keys() == {PLAIN}
    assert told.peak_mib > 50


def test_the_benchmark_compares_in_processes_of_its_own(packed, monkeypatch):
    monkeypatch.setattr("aug3d_core.bench.nerf.paper", lambda changes: LITTLE)
    monkeypatch.setattr("aug3d_core.bench.nerf.SIDE_PX", 16)
    figures = speed_figures(packed, "h64", lambda *_: None)
    assert figures["output_max_abs_diff_h64"].value < 1e-4
    assert figures["train_speedup_h64"].goal == 3.0
    assert figures["train_peak_mib_h64"].value > 50
