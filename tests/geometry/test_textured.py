from filecmp import cmp

import numpy as np
import pytest

from aug3d_core.geometry.textured import TexturedMesh


def corners() -> TexturedMesh:
    """A triangle over the upper left half of a picture 3 wide and 2 high."""
    texture = np.arange(18, dtype=np.uint8).reshape(2, 3, 3) * 10
    uv = np.array([[[0, 1], [0, 0], [1, 1.0]]])  # top left, bottom left, top right
    return TexturedMesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32), uv, texture)


def test_v_points_up_and_texel_centres_have_the_texels_colours():
    mesh = corners()
    for row, column in ((0, 0), (0, 1), (1, 0)):
        u, v = (column + 0.5) / 3, 1 - (row + 0.5) / 2
        weights = np.array([[v - u, 1 - v, u]])  # of the point (u, v) in that triangle
        np.testing.assert_allclose(mesh.colour_at(np.array([0]), weights), [mesh.texture[row, column]], atol=1e-9)


def test_between_texels_colours_are_bilinear_and_the_rim_is_clamped():
    mesh = corners()
    between = mesh.colour_at(np.array([0]), np.array([[1 - 1 / 3 - 0.25, 0.25, 1 / 3]]))
    np.testing.assert_allclose(between, [(mesh.texture[0, 0].astype(float) + mesh.texture[0, 1]) / 2])
    np.testing.assert_allclose(mesh.colour_at(np.array([0]), np.array([[1.0, 0, 0]])), [mesh.texture[0, 0]])


def test_files_give_back_the_arrays_in_the_same_bytes(tmp_path):
    for name in "ab":
        corners().save(tmp_path / f"{name}.npz", tmp_path / f"{name}.png")
    assert cmp(tmp_path / "a.npz", tmp_path / "b.npz", shallow=False)
    assert cmp(tmp_path / "a.png", tmp_path / "b.png", shallow=False)
    again = TexturedMesh.load(tmp_path / "a.npz", tmp_path / "a.png")
    for name in ("xyz", "triangles", "uv", "texture"):
        np.testing.assert_array_equal(getattr(again, name), getattr(corners(), name))


def test_a_file_without_coordinates_is_refused(tmp_path):
    corners().save(tmp_path / "a.npz", tmp_path / "a.png")
    np.savez(tmp_path / "a.npz", vertices=np.zeros((3, 3)), triangles=np.zeros((1, 3), int))
    with pytest.raises(KeyError, match="uv"):
        TexturedMesh.load(tmp_path / "a.npz", tmp_path / "a.png")
