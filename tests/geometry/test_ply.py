from filecmp import cmp

import numpy as np
import pytest

from aug3d_core.geometry.ply import Mesh


def some_mesh(vertices: int = 7, triangles: int = 11) -> Mesh:
    rng = np.random.default_rng(0)
    return Mesh(
        rng.normal(size=(vertices, 3)).astype(np.float32),
        rng.integers(0, 256, (vertices, 3), dtype=np.uint8),
        rng.integers(0, vertices, (triangles, 3)).astype(np.int32),
    )


def test_round_trip_is_exact_and_bytes_repeat(tmp_path):
    mesh = some_mesh()
    mesh.save(tmp_path / "a.ply")
    again = Mesh.load(tmp_path / "a.ply")
    np.testing.assert_array_equal(again.xyz, mesh.xyz)
    np.testing.assert_array_equal(again.rgb, mesh.rgb)
    np.testing.assert_array_equal(again.triangles, mesh.triangles)
    again.save(tmp_path / "b.ply")
    assert cmp(tmp_path / "a.ply", tmp_path / "b.ply", shallow=False)


def test_an_empty_mesh_survives(tmp_path):
    mesh = Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8), np.zeros((0, 3), np.int32))
    mesh.save(tmp_path / "a.ply")
    assert Mesh.load(tmp_path / "a.ply").xyz.shape == (0, 3)


def test_truncated_and_foreign_files_are_refused(tmp_path):
    path = tmp_path / "a.ply"
    some_mesh().save(path)
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(ValueError, match="truncated"):
        Mesh.load(path)
    path.write_bytes(b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n")
    with pytest.raises(ValueError, match="not a vertex-coloured"):
        Mesh.load(path)
