"""The stage around the worker: shards, resuming, judging. The worker itself is in tests/engines."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from aug3d_core.domes.files import CAMERAS
from aug3d_core.geometry.ply import Mesh
from aug3d_core.rendering import stage
from aug3d_core.rendering.config import RenderingConfig
from aug3d_core.rendering.files import RENDER_TABLE, SHARDS
from aug3d_core.rendering.job import Emission, Sunlit
from aug3d_core.rendering.launch import Spent
from aug3d_core.rendering.probe import Chosen
from aug3d_core.run.errors import InputError
from aug3d_core.surface.files import MESH, MESH_TEXTURE, TEXTURED_MESH

WIDTH, HEIGHT = 11, 7


class Renderer:
    """Stand in for the workers: view v has columns of levels v and v + 9, and v % 5 of its rows are empty."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.jobs = []

    def render(self, job, on_view, workers=1) -> Spent:
        self.jobs.append(job)
        missing = [shard for shard in job.shards if not shard.out.exists()]
        spent = Spent()
        for shard in missing:
            self.asked.append(shard.out.name)
            view_id = np.arange(shard.first, shard.last)
            rgb = np.zeros((len(view_id), HEIGHT, WIDTH, 3), np.uint8) + view_id[:, None, None, None].astype(np.uint8)
            rgb[:, :, ::2] += np.uint8(9) * (view_id != 11)[:, None, None, None].astype(np.uint8)
            rgb[view_id < 3] = 0
            alpha = np.full((len(view_id), HEIGHT, WIDTH), 255, np.uint8)
            for i, v in enumerate(view_id):
                alpha[i, : v % 5] = 0
                spent.views += 1
                on_view(spent.views)
            with shard.out.open("wb") as file:
                np.savez(file, view_id=view_id, rgb=rgb, alpha=alpha, depth=np.ones(alpha.shape, np.float16))
        spent.worker_s, spent.cycles_s = len(missing) * 1.0, len(missing) * 0.95
        return spent


@pytest.fixture
def renderer(monkeypatch) -> Renderer:
    stand_in = Renderer()
    monkeypatch.setattr(stage, "render", stand_in.render)
    monkeypatch.setattr(stage, "choose_samples", lambda *_: Chosen(8, 38.5, "enough"))
    return stand_in


def plan(folder: Path, views: int) -> dict[str, Path]:
    folder.mkdir(exist_ok=True)
    np.savez(
        folder / CAMERAS,
        view_id=np.arange(views),
        dome_id=np.arange(views) // 4,
        world_from_cam=np.tile(np.eye(4), (views, 1, 1)),
        intrinsics=np.tile([10.0, 10.0, WIDTH / 2, HEIGHT / 2], (views, 1)),
        size=np.tile([WIDTH, HEIGHT], (views, 1)),
    )
    Mesh(np.eye(3, dtype=np.float32), np.zeros((3, 3), np.uint8), np.array([[0, 1, 2]], np.int32)).save(folder / MESH)
    return {"sampling": folder, "surface": folder}


def run(tmp_path: Path, views: int = 12, **config):
    out = tmp_path / "out"
    out.mkdir(exist_ok=True)
    told = []
    outcome = stage.run(
        plan(tmp_path / "in", views), RenderingConfig(views_per_shard=4, **config), out, lambda *p: told.append(p)
    )
    return outcome, pd.read_parquet(out / RENDER_TABLE), told


def test_views_are_dropped_with_a_reason(renderer, tmp_path):
    outcome, table, told = run(tmp_path, min_covered_share=0.7)
    assert table["view_id"].tolist() == list(range(12))
    assert table["dome_id"].tolist() == [0] * 4 + [1] * 4 + [2] * 4
    assert table["shard"].tolist() == [0] * 4 + [1] * 4 + [2] * 4
    assert table["row"].tolist() == [0, 1, 2, 3] * 3
    np.testing.assert_allclose(table["covered_share"], 1 - np.arange(12) % 5 / 7)
    black, bare, flat = "black", "too little surface", "flat"
    assert table["reason"].tolist() == [black, black, black, bare, bare, "", "", "", bare, bare, "", flat]
    assert outcome.metrics["kept"] == 4 and outcome.metrics["views"] == 12
    assert [outcome.metrics[f"dropped_{why}"] for why in ("black", "too_little_surface", "flat")] == [3, 4, 1]
    assert told[-1] == (12, 12, "views rendered") and [p[0] for p in told] == sorted(p[0] for p in told)


def test_what_it_cost_is_told(renderer, tmp_path):
    outcome, _, _ = run(tmp_path)
    assert (outcome.metrics["samples"], outcome.metrics["samples_psnr_db"]) == (8, 38.5)
    assert outcome.metrics["overhead_share"] == pytest.approx(0.05)
    assert all(shard.samples == 8 for shard in renderer.jobs[0].shards)


def test_samples_by_hand_are_not_probed(renderer, tmp_path, monkeypatch):
    monkeypatch.setattr(stage, "choose_samples", None)
    outcome, _, _ = run(tmp_path, samples=3)
    assert (outcome.metrics["samples"], outcome.metrics["samples_psnr_db"]) == (3, None)


def test_too_few_samples_for_the_light_are_told(renderer, tmp_path, monkeypatch):
    monkeypatch.setattr(stage, "choose_samples", lambda *_: Chosen(48, 36.0, "even 48 samples stay below"))
    outcome, _, _ = run(tmp_path)
    assert outcome.state == "degraded" and "even 48" in outcome.notes[0]


def test_the_light_is_the_configuration_s(renderer, tmp_path):
    run(tmp_path)
    run(tmp_path, light="sunlit", sun_azimuth_deg=90, sun_elevation_deg=30)
    assert renderer.jobs[0].light == Emission()
    assert renderer.jobs[1].light == Sunlit(sun_azimuth_deg=90, sun_elevation_deg=30).exposed()


def test_shards_that_exist_are_not_rendered_again(renderer, tmp_path):
    first, table, _ = run(tmp_path)
    assert renderer.asked == ["0000.npz", "0001.npz", "0002.npz"]
    (tmp_path / "out" / SHARDS / "0001.npz").unlink()
    _, again, told = run(tmp_path)
    assert renderer.asked[3:] == ["0001.npz"]
    assert [done for done, _, what in told if what == "views rendered"] == [8, 9, 10, 11, 12]
    pd.testing.assert_frame_equal(table, again)
    third, _, _ = run(tmp_path)
    assert third.metrics["views_per_minute"] is None and first.metrics["views_per_minute"] > 0
    assert third.metrics["overhead_share"] is None


def test_a_machine_that_helps_renders_what_is_not_there(renderer, tmp_path):
    run(tmp_path)
    shards = tmp_path / "out" / SHARDS
    as_it_was = {shard.name: shard.read_bytes() for shard in shards.iterdir()}
    for name in ("0000.npz", "0002.npz"):
        (shards / name).unlink()
    config = RenderingConfig(views_per_shard=4)
    assert stage.assist(plan(tmp_path / "in", 12), config, tmp_path / "out", lambda *_: None).metrics["views"] == 8
    assert sorted(renderer.asked[3:]) == ["0000.npz", "0002.npz"]
    assert {shard.name: shard.read_bytes() for shard in shards.iterdir()} == as_it_was


def test_a_machine_that_helps_with_no_views_has_nothing_to_do(renderer, tmp_path):
    outcome = stage.assist(plan(tmp_path / "in", 0), RenderingConfig(), tmp_path / "out", lambda *_: None)
    assert outcome.metrics["views"] == 0 and not renderer.asked


@pytest.mark.parametrize("torn", [b"", b"PK", bytes(4000)])
def test_shards_that_a_power_cut_tore_are_rendered_again(renderer, tmp_path, torn):
    _, table, _ = run(tmp_path)
    (tmp_path / "out" / SHARDS / "0001.npz").write_bytes(torn)
    _, again, _ = run(tmp_path)
    assert renderer.asked[3:] == ["0001.npz"]
    pd.testing.assert_frame_equal(table, again)


def test_what_killed_workers_left_beside_shards_is_no_output(renderer, tmp_path):
    run(tmp_path)
    out = tmp_path / "out"
    as_it_was = {*out.rglob("*")}
    (out / SHARDS / "tmpabc").mkdir()
    (out / SHARDS / "tmpabc" / "view.exr").write_bytes(b"half a view")
    (out / SHARDS / "0001.part").write_bytes(b"half a shard, that another machine made meanwhile")
    run(tmp_path)
    assert {*out.rglob("*")} == as_it_was and len(renderer.asked) == 3


def test_samples_are_probed_on_the_disk_of_the_shards(renderer, tmp_path, monkeypatch):
    def probe(_job, _cameras, scratch: Path) -> Chosen:
        assert out in scratch.parents and not [*scratch.iterdir()]
        (scratch / "probe.npz").touch()
        return Chosen(8, 38.5, "enough")

    out = tmp_path / "out"
    monkeypatch.setattr(stage, "choose_samples", probe)
    run(tmp_path)
    assert not [*out.rglob("probe.npz")]


def test_shards_are_equal_and_do_not_depend_on_the_machine(renderer, tmp_path, monkeypatch):
    monkeypatch.setattr(stage.os, "sched_getaffinity", lambda _: set(range(16)))
    run(tmp_path, views=10)
    job = renderer.jobs[0]
    assert [(shard.first, shard.last) for shard in job.shards] == [(0, 3), (3, 6), (6, 10)]
    assert job.threads == 5


def test_nothing_worth_keeping_is_an_error(renderer, tmp_path):
    with pytest.raises(InputError, match="none of the 3"):
        run(tmp_path, views=3)


def test_an_empty_plan_is_an_answer(renderer, tmp_path):
    full = run(tmp_path)[1]
    (tmp_path / "again").mkdir()
    outcome, table, _ = run(tmp_path / "again", views=0)
    assert outcome.state == "ok" and "photographs only" in outcome.notes[0]
    assert outcome.metrics["views"] == 0 and len(table) == 0
    assert list(table.columns) == list(full.columns)
    assert table["kept"].dtype == bool
    assert not renderer.asked[3:]


def test_an_empty_plan_asks_for_no_mesh(renderer, tmp_path):
    inputs = plan(tmp_path / "in", 0)
    (tmp_path / "in" / MESH).unlink()
    assert stage.run(inputs, RenderingConfig(), tmp_path, lambda *_: None).metrics["views"] == 0


def test_the_texture_is_used_when_there_is_one(renderer, tmp_path):
    run(tmp_path)
    folder = tmp_path / "in"
    assert (renderer.jobs[0].meshes[0].path, renderer.jobs[0].meshes[0].texture) == (folder / MESH, None)
    np.savez(folder / TEXTURED_MESH, vertices=np.eye(3), triangles=[[0, 1, 2]], uv=np.zeros((1, 3, 2)))
    Image.new("RGB", (4, 4)).save(folder / MESH_TEXTURE)
    run(tmp_path)
    mesh = renderer.jobs[1].meshes[0]
    assert (mesh.path, mesh.texture) == (folder / TEXTURED_MESH, folder / MESH_TEXTURE)
