"""How the number of samples is chosen, with a renderer whose error is known."""

import numpy as np
import pytest

from aug3d_core.rendering import probe
from aug3d_core.rendering.job import MeshFile, RenderJob
from aug3d_core.rendering.probe import ENOUGH_DB, choose_samples, pick, psnr_db


def test_psnr_is_over_what_either_shows():
    rgb, alpha = np.full((1, 4, 4, 3), 100, np.uint8), np.zeros((1, 4, 4), np.uint8)
    alpha[0, 0] = 255
    off = rgb.copy()
    off[0, 0] = 110  # a quarter of the view is covered, and all of that is off by 10
    assert psnr_db((off, alpha), (rgb, alpha))[0] == pytest.approx(20 * np.log10(25.5))
    assert psnr_db((rgb, alpha), (rgb, alpha))[0] == np.inf


def test_a_hole_where_there_is_surface_is_an_error():
    rgb, alpha = np.full((1, 4, 4, 3), 100, np.uint8), np.full((1, 4, 4), 255, np.uint8)
    holed = alpha.copy()
    holed[0, 0] = 0
    assert psnr_db((rgb, holed), (rgb, alpha))[0] == pytest.approx(20 * np.log10(2 * 2.55))


def test_the_fewest_that_are_enough_are_picked():
    chosen = pick({1: 25.0, 4: 37.9, 8: 38.0, 16: 44.0})
    assert (chosen.samples, chosen.psnr_db) == (8, 38.0)
    assert "fewest" in chosen.reason


def test_the_most_are_picked_and_told_when_none_is_enough():
    chosen = pick({1: 25.0, 16: 36.0})
    assert (chosen.samples, chosen.psnr_db) == (16, 36.0)
    assert "even 16 samples" in chosen.reason


@pytest.mark.parametrize("views", [1, 2, 5, 100])
def test_probe_views_are_spread_and_the_worst_of_them_counts(tmp_path, monkeypatch, views):
    """Views are off by 24 / samples levels, the last of the probe views by twice that."""
    seen = []

    def render(job, on_view):
        with np.load(job.cameras) as cameras:
            seen.extend(cameras["view_id"].tolist())
        count = len(seen)
        for shard in job.shards:
            rgb = np.full((count, 6, 8, 3), 100, np.uint8)
            if shard.out.stem != "reference":
                rgb += np.uint8(24 / shard.samples)
                rgb[-1] += np.uint8(24 / shard.samples)
            np.savez(shard.out, rgb=rgb, alpha=np.full((count, 6, 8), 255, np.uint8))

    monkeypatch.setattr(probe, "render", render)
    job = RenderJob(meshes=(MeshFile(path=tmp_path / "m.ply"),), cameras=tmp_path / "c.npz", shards=())
    chosen = choose_samples(job, {"view_id": np.arange(views)}, tmp_path)
    assert 1 <= len(seen) == len(set(seen)) <= 4
    if views == 100:
        assert np.diff([0, *seen, 99]).min() > 8, "neither the ends of the plan nor neighbours"
    assert chosen.samples == 16, "an error of 2 levels is 42 dB, one of 4 levels 36 dB"
    assert chosen.psnr_db >= ENOUGH_DB
