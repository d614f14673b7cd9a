"""The views that are measured, and the finer mesh, against numbers known beforehand."""

from filecmp import cmp

import numpy as np
import pytest

from aug3d_core.bench import render_speed
from aug3d_core.bench.render_speed import Speed, draw_speeds, many_views, quartered, resized, speeds
from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.rendering.job import MeshFile
from aug3d_core.surface.files import MESH_TEXTURE, TEXTURED_MESH

SIZE = (128, 96)


def planned(count: int = 3) -> dict[str, np.ndarray]:
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, 0, 3] = np.arange(count)
    return {
        "view_id": np.arange(count),
        "dome_id": np.zeros(count, int),
        "world_from_cam": poses,
        "intrinsics": np.tile([90.0, 90.0, 48.0, 36.0], (count, 1)),
        "size": np.tile([96, 72], (count, 1)),
    }


def test_no_view_is_another_and_all_look_where_the_plan_looks():
    views = many_views(planned(), 50, SIZE)
    assert len(views["view_id"]) == 50 and (views["size"] == SIZE).all()
    rotations = views["world_from_cam"][:, :3, :3]
    np.testing.assert_allclose(rotations @ rotations.transpose(0, 2, 1), np.tile(np.eye(3), (50, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(rotations), 1)
    np.testing.assert_allclose(rotations[:, :, 2], np.tile([0, 0, 1], (50, 1)), atol=1e-12)
    assert (views["world_from_cam"][:, 0, 3] == np.arange(50) % 3).all()
    assert len(np.unique(views["world_from_cam"].round(6), axis=0)) == 50


def test_the_field_of_view_is_the_plan_s():
    intrinsics = many_views(planned(), 4, SIZE)["intrinsics"]
    np.testing.assert_allclose(intrinsics, np.tile([120.0, 120.0, 64.0, 48.0], (4, 1)))
    small = resized(many_views(planned(), 4, SIZE), 64)
    assert (small["size"] == (64, 48)).all()
    np.testing.assert_allclose(small["intrinsics"], np.tile([60.0, 60.0, 32.0, 24.0], (4, 1)))


def test_a_quartered_mesh_is_the_same_surface_with_the_same_picture():
    rng = np.random.default_rng(0)
    corners = np.array([[0, 1, 2], [2, 1, 3]])
    mesh = TexturedMesh(rng.normal(size=(4, 3)), corners, rng.random((2, 3, 2)), np.zeros((4, 4, 3), np.uint8))
    finer = quartered(mesh)
    assert len(finer.triangles) == 8

    def areas(m: TexturedMesh) -> np.ndarray:
        a, b, c = m.xyz[m.triangles].transpose(1, 0, 2)
        return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2

    np.testing.assert_allclose(areas(finer).reshape(2, 4), np.repeat(areas(mesh)[:, None] / 4, 4, axis=1))
    for triangle in range(2):  # texture coordinates are the same linear function of place
        frame = np.column_stack([mesh.xyz[corners[triangle]], np.ones(3)])
        uv_of = np.linalg.lstsq(frame, mesh.uv[triangle], rcond=None)[0]
        places = finer.xyz[finer.triangles[4 * triangle : 4 * triangle + 4]].reshape(-1, 3)
        expected = np.column_stack([places, np.ones(12)]) @ uv_of
        np.testing.assert_allclose(finer.uv[4 * triangle : 4 * triangle + 4].reshape(-1, 2), expected, atol=1e-9)


def test_each_value_is_timed_without_its_first_view(monkeypatch, tmp_path):
    """A renderer that needs 10 s for the first view of a shard and a second per sample for the others."""
    now = [0.0]

    def render(job, on_view):
        for shard in job.shards:
            for row in range(shard.first, shard.last):
                now[0] += shard.samples if row > shard.first else 10
                on_view(row + 1)

    monkeypatch.setattr(render_speed, "render", render)
    monkeypatch.setattr(render_speed, "find_mesh", lambda folder: MeshFile(path=folder))
    monkeypatch.setattr(render_speed.time, "monotonic", lambda: now[0])
    mesh = TexturedMesh(np.eye(3), np.array([[0, 1, 2]]), np.zeros((1, 3, 2)), np.zeros((4, 4, 3), np.uint8))
    mesh.save(tmp_path / TEXTURED_MESH, tmp_path / MESH_TEXTURE)
    told = speeds(tmp_path, many_views(planned(), 30, SIZE), 8, tmp_path, lambda *_: None)
    for speed in told:
        expected = 1 / speed.value if speed.setting == "samples per pixel" else 1 / 8
        assert speed.views_per_second == pytest.approx(expected)
    assert [speed.value for speed in told if speed.default] == [8, 128, 1]
    assert [speed.value for speed in told if speed.setting == "triangles"] == [1, 4, 16]


def test_speeds_become_a_picture(tmp_path):
    told = [Speed("samples per pixel", n, n == 4, 10 / n) for n in (1, 4, 16)] + [Speed("triangles", 1000, True, 7.0)]
    draw_speeds(told, tmp_path / "a.png")
    draw_speeds(told, tmp_path / "b.png")
    assert cmp(tmp_path / "a.png", tmp_path / "b.png", shallow=False)


@pytest.mark.parametrize("count", [1, 7])
def test_fewer_views_than_planned_are_the_first_of_them(count):
    views = many_views(planned(10), count, SIZE)
    np.testing.assert_array_equal(views["world_from_cam"], planned(10)["world_from_cam"][:count])
