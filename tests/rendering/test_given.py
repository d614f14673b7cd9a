"""Every way in which cameras or a mesh cannot be rendered is named before a worker starts."""

from pathlib import Path

import numpy as np
import pytest

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.rendering.given import find_mesh, read_cameras
from aug3d_core.run.errors import InputError
from aug3d_core.surface.files import MESH, MESH_TEXTURE, TEXTURED_MESH


def cameras(**changes) -> dict[str, np.ndarray]:
    return {
        "view_id": np.arange(10, 14),
        "dome_id": np.zeros(4, int),
        "world_from_cam": np.tile(np.eye(4), (4, 1, 1)),
        "intrinsics": np.tile([10.0, 10.0, 6.0, 4.0], (4, 1)),
        "size": np.tile([12, 8], (4, 1)),
    } | changes


def read(folder: Path, **changes) -> dict[str, np.ndarray]:
    np.savez(folder / "cameras.npz", **{name: array for name, array in cameras(**changes).items() if array is not None})
    return read_cameras(folder / "cameras.npz")


def changed(name: str, row: int, value: object) -> dict[str, np.ndarray]:
    array = cameras()[name].copy()
    array[row] = value
    return {name: array}


def test_cameras_come_back_as_they_are(tmp_path):
    for name, array in read(tmp_path).items():
        np.testing.assert_array_equal(array, cameras()[name])


def test_no_cameras_are_cameras_too(tmp_path):
    assert len(read(tmp_path, **{name: array[:0] for name, array in cameras().items()})["view_id"]) == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (changed("world_from_cam", 2, np.nan), r"view 12 has a pose that is not finite\n"),
        (changed("world_from_cam", slice(1, 4), np.inf), r"view 11 has a pose that is not finite \(and 2 others\)"),
        (changed("intrinsics", 3, np.nan), "view 13 has intrinsics that are not finite"),
        (changed("intrinsics", 0, -1.0), "view 10 has a focal length that is not positive"),
        (changed("size", 1, 0), "view 11 has no pixels"),
        (changed("size", 0, (8, 12)), "differ in size"),
        ({"size": np.ones((3, 2), int)}, "size has 3 rows for 4 views"),
        ({"intrinsics": None}, r"cameras\.npz cannot be read .*intrinsics"),
    ],
)
def test_cameras_that_cannot_be_rendered_are_named(tmp_path, change, message):
    with pytest.raises(InputError, match=message):
        read(tmp_path, **change)


def test_a_torn_camera_file_is_named(tmp_path):
    read(tmp_path)
    whole = (tmp_path / "cameras.npz").read_bytes()
    (tmp_path / "cameras.npz").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"cameras\.npz cannot be read"):
        read_cameras(tmp_path / "cameras.npz")


def coloured(folder: Path, triangles: int = 1) -> None:
    corners = np.array([[0, 1, 2]] * triangles, np.int32).reshape(-1, 3)
    Mesh(np.eye(3, dtype=np.float32), np.zeros((3, 3), np.uint8), corners).save(folder / MESH)


def textured(folder: Path, triangles: int = 1) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (64, 64, 3)).astype(np.uint8)
    corners = np.array([[0, 1, 2]] * triangles, np.int32).reshape(-1, 3)
    mesh = TexturedMesh(np.eye(3), corners, np.zeros((triangles, 3, 2)), picture)
    mesh.save(folder / TEXTURED_MESH, folder / MESH_TEXTURE)


def test_a_mesh_is_found_with_its_texture_if_it_has_one(tmp_path):
    coloured(tmp_path)
    assert find_mesh(tmp_path).texture is None
    textured(tmp_path)
    assert find_mesh(tmp_path).texture == tmp_path / MESH_TEXTURE


@pytest.mark.parametrize("make", [coloured, textured])
def test_an_empty_mesh_is_refused(tmp_path, make):
    make(tmp_path, 0)
    with pytest.raises(InputError, match="has no triangles"):
        find_mesh(tmp_path)


@pytest.mark.parametrize("name", [MESH, TEXTURED_MESH])
def test_a_torn_mesh_is_named(tmp_path, name):
    coloured(tmp_path) if name == MESH else textured(tmp_path)
    (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:-40])
    with pytest.raises(InputError, match=f"the mesh {name} cannot be read"):
        find_mesh(tmp_path)


def test_a_missing_mesh_is_named(tmp_path):
    with pytest.raises(InputError, match=r"the mesh mesh\.ply cannot be read"):
        find_mesh(tmp_path)


def test_a_missing_texture_is_named(tmp_path):
    textured(tmp_path)
    (tmp_path / MESH_TEXTURE).unlink()
    with pytest.raises(InputError, match=r"the texture mesh_texture\.png cannot be read"):
        find_mesh(tmp_path)


@pytest.mark.parametrize("keep", [8, 40, 3000])
def test_a_torn_texture_is_named(tmp_path, keep):
    textured(tmp_path)
    torn = (tmp_path / MESH_TEXTURE).read_bytes()[:keep]
    (tmp_path / MESH_TEXTURE).write_bytes(torn)
    with pytest.raises(InputError, match=r"the texture mesh_texture\.png cannot be read"):
        find_mesh(tmp_path)


def test_a_texture_that_is_no_picture_is_named(tmp_path):
    textured(tmp_path)
    (tmp_path / MESH_TEXTURE).write_text("a note")
    with pytest.raises(InputError, match=r"the texture mesh_texture\.png cannot be read"):
        find_mesh(tmp_path)
