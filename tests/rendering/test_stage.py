"""The stage around the worker: shards, resuming, judging. The worker itself is in tests/engines."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from aug3d_core.errors import InputError
from aug3d_core.rendering import stage
from aug3d_core.rendering.config import RenderingConfig
from aug3d_core.store import layout

WIDTH, HEIGHT = 11, 7


@pytest.fixture
def rendered(monkeypatch):
    """Replace the worker: view v is of grey level v with v % 5 rows empty; return the shards that it was asked for."""
    asked = []

    def render(job, on_view):
        asked.append(job.out.name)
        view_id = np.arange(job.first, job.last)
        rgb = np.zeros((len(view_id), HEIGHT, WIDTH, 3), np.uint8) + view_id[:, None, None, None].astype(np.uint8)
        alpha = np.full((len(view_id), HEIGHT, WIDTH), 255, np.uint8)
        for i, v in enumerate(view_id):
            alpha[i, : v % 5] = 0
            on_view(i + 1)
        with job.out.open("wb") as file:
            np.savez(file, view_id=view_id, rgb=rgb, alpha=alpha, depth=np.ones(alpha.shape, np.float16))

    monkeypatch.setattr(stage, "render", render)
    return asked


def plan(folder: Path, views: int) -> dict[str, Path]:
    folder.mkdir(exist_ok=True)
    size = np.tile([WIDTH, HEIGHT], (views, 1))
    np.savez(folder / layout.CAMERAS, view_id=np.arange(views), dome_id=np.arange(views) // 4, size=size)
    return {"sampling": folder, "surface": folder}


def run(tmp_path: Path, views: int = 10, **config):
    out = tmp_path / "out"
    out.mkdir(exist_ok=True)
    told = []
    outcome = stage.run(
        plan(tmp_path / "in", views), RenderingConfig(views_per_shard=4, **config), out, lambda *p: told.append(p)
    )
    return outcome, pd.read_parquet(out / layout.RENDER_TABLE), told


def test_views_are_dropped_with_a_reason(rendered, tmp_path):
    outcome, table, told = run(tmp_path, min_covered_share=0.7)
    assert table["view_id"].tolist() == list(range(10))
    assert table["dome_id"].tolist() == [0, 0, 0, 0, 1, 1, 1, 1, 2, 2]
    assert table["shard"].tolist() == [0, 0, 0, 0, 1, 1, 1, 1, 2, 2]
    assert table["row"].tolist() == [0, 1, 2, 3, 0, 1, 2, 3, 0, 1]
    np.testing.assert_allclose(table["covered_share"], 1 - np.arange(10) % 5 / 7)
    black, bare = "black", "too little surface"
    assert table["reason"].tolist() == [black, black, black, bare, bare, "", "", "", bare, bare]
    assert outcome.metrics["kept"] == 3 and outcome.metrics["views"] == 10
    assert outcome.metrics["dropped_black"] == 3 and outcome.metrics["dropped_too_little_surface"] == 4
    assert told[-1] == (10, 10, "views rendered") and [p[0] for p in told] == sorted(p[0] for p in told)


def test_shards_that_exist_are_not_rendered_again(rendered, tmp_path):
    first, table, _ = run(tmp_path)
    assert rendered == ["0000.npz", "0001.npz", "0002.npz"]
    (tmp_path / "out" / layout.SHARDS / "0001.npz").unlink()
    _, again, _ = run(tmp_path)
    assert rendered[3:] == ["0001.npz"]
    pd.testing.assert_frame_equal(table, again)
    third, _, _ = run(tmp_path)
    assert third.metrics["views_per_minute"] is None and first.metrics["views_per_minute"] > 0


def test_nothing_worth_keeping_is_an_error(rendered, tmp_path):
    with pytest.raises(InputError, match="none of the 3"):
        run(tmp_path, views=3)


def test_an_empty_plan_is_an_error(rendered, tmp_path):
    with pytest.raises(InputError, match="no views"):
        run(tmp_path, views=0)


def test_views_of_several_sizes_are_an_error(rendered, tmp_path):
    folder = tmp_path / "in"
    inputs = plan(folder, 2)
    np.savez(folder / layout.CAMERAS, view_id=np.arange(2), dome_id=np.zeros(2, int), size=np.array([[11, 7], [7, 11]]))
    with pytest.raises(InputError, match="differ in size"):
        stage.run(inputs, RenderingConfig(), tmp_path, lambda *_: None)


def test_the_texture_is_used_when_there_is_one(rendered, tmp_path, monkeypatch):
    jobs = []
    worker = stage.render
    monkeypatch.setattr(stage, "render", lambda job, on_view: (jobs.append(job), worker(job, on_view)))
    run(tmp_path, views=4, min_covered_share=0.0)
    folder = tmp_path / "in"
    assert (jobs[-1].meshes[0].path, jobs[-1].meshes[0].texture) == (folder / layout.MESH, None)
    (folder / layout.TEXTURED_MESH).touch()
    (tmp_path / "out" / layout.SHARDS / "0000.npz").unlink()
    run(tmp_path, views=4, min_covered_share=0.0)
    mesh = jobs[-1].meshes[0]
    assert (mesh.path, mesh.texture) == (folder / layout.TEXTURED_MESH, folder / layout.MESH_TEXTURE)
