import numpy as np
import pytest

from aug3d_core.geometry.ply import Mesh
from aug3d_core.town.config import TownConfig
from aug3d_core.town.generator.terrain import HILLS, bend
from aug3d_core.town.generator.town import Town, build_town, coloured_mesh

SMALL = TownConfig(length_m=60, width_m=60)


@pytest.fixture(scope="module")
def town() -> Town:
    return build_town(SMALL, HILLS, np.random.default_rng(3))


def test_the_same_seed_gives_the_same_town(town):
    again = build_town(SMALL, HILLS, np.random.default_rng(3))
    for a, b in ((town.ground, again.ground), (town.things, again.things)):
        for name in ("vertices", "triangles", "uv"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    np.testing.assert_array_equal(town.ground_image, again.ground_image)
    np.testing.assert_array_equal(town.things_image, again.things_image)


def test_texture_coordinates_lie_in_the_textures(town):
    for mesh in (town.ground, town.things):
        assert mesh.uv.shape == (len(mesh.triangles), 3, 2)
        assert mesh.uv.min() >= 0 and mesh.uv.max() <= 1
        assert mesh.triangles.min() == 0 and mesh.triangles.max() == len(mesh.vertices) - 1


def test_the_ground_faces_up_and_covers_town_and_country(town):
    a, b, c = (town.ground.vertices[town.ground.triangles[:, i]] for i in range(3))
    up = np.cross(b - a, c - a)[:, 2] / 2
    assert (up > 0).all()
    assert up.sum() == pytest.approx(180 * 180, rel=0.02)


def test_footprints_are_counter_clockwise_and_under_their_buildings(town):
    vertices = town.things.vertices
    assert town.footprints
    for footprint in town.footprints:
        x, y = footprint.outline_m.T
        assert (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() > 0
        at = footprint.outline_m.mean(axis=0)
        near = vertices[np.linalg.norm(vertices[:, :2] - at, axis=1) < np.linalg.norm(footprint.outline_m[0] - at)]
        ground = bend(np.array([[0.0, 0.0, 0.0]]))[0, 2]
        assert near[:, 2].max() > ground + footprint.height_m - 3


def test_bending_moves_neighbours_together():
    """A wall of 12 m must stay straight to a few centimetres, and nothing may fold over."""
    rng = np.random.default_rng(0)
    at = rng.uniform(-100, 100, (500, 3))
    step = rng.normal(size=(500, 3))
    step = 6 * step / np.linalg.norm(step, axis=1, keepdims=True)
    sag = np.linalg.norm((bend(at + step) + bend(at - step)) / 2 - bend(at), axis=1)
    stretch = np.linalg.norm(bend(at + step) - bend(at - step), axis=1) / 12
    assert sag.max() < 0.08
    assert stretch.min() > 0.9 and stretch.max() < 1.1


def test_the_truth_mesh_holds_the_whole_town(town, tmp_path):
    mesh = coloured_mesh(town)
    assert len(mesh.triangles) == len(town.ground.triangles) + len(town.things.triangles)
    mesh.save(tmp_path / "mesh.ply")
    np.testing.assert_allclose(Mesh.load(tmp_path / "mesh.ply").xyz, mesh.xyz, atol=1e-4)
    grass = mesh.rgb[: len(town.ground.vertices)].mean(axis=0)
    assert grass[1] > grass[2], "most ground is green or brown, not blue"
