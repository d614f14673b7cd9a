import numpy as np
import pytest

from aug3d_core.town.generator.atlas import Atlas
from aug3d_core.town.generator.buildings import add_building
from aug3d_core.town.generator.model import Frame, Model
from aug3d_core.town.generator.plan import Building
from aug3d_core.town.generator.swatches import add_swatches


def build(roof: str, use: str = "shed", pitch_deg: float = 45.0):
    rng, atlas, model = np.random.default_rng(0), Atlas(), Model()
    swatches = add_swatches(atlas, rng)
    building = Building(Frame(0.0, 0.0, 0.0), 10.0, 6.0, 4.0, roof, pitch_deg, use)
    height = add_building(model, atlas, swatches, building, rng)
    return height, model, atlas


@pytest.mark.parametrize("roof", ["gable", "hip"])
def test_a_pitched_roof_rises_half_the_depth_at_45_degrees(roof):
    height, model, _ = build(roof)
    assert height == pytest.approx(7.0)
    assert model.arrays()[0][:, 2].max() == pytest.approx(7.0, abs=0.07)


@pytest.mark.parametrize("roof", ["gable", "hip", "flat"])
def test_roofs_and_walls_face_outwards(roof):
    _, model, _ = build(roof)
    vertices, triangles, _, _ = model.arrays()
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    normal, middle = np.cross(b - a, c - a), (a + b + c) / 3
    outside = (np.abs(middle[:, 0]) > 4.95) | (np.abs(middle[:, 1]) > 2.95) | (middle[:, 2] > 4.6)
    away = normal * (middle - [0, 0, 1.0])
    assert (away.sum(axis=1)[outside] > 0).all()


def test_a_flat_roof_lies_under_its_rim():
    height, model, _ = build("flat", use="house")
    levels = set(np.round(model.arrays()[0][:, 2], 3))
    assert {4.0, 4.55} <= levels and height >= 4.55


@pytest.mark.parametrize(("roof", "use"), [("gable", "row"), ("hip", "house"), ("flat", "flats"), ("flat", "hall")])
def test_every_triangle_points_into_a_patch(roof, use):
    _, model, atlas = build(roof, use)
    _, _, patches, uv = model.arrays()
    assert patches.max() < len(atlas.patches)
    assert uv.min() >= -1e-9 and uv.max() <= 1 + 1e-9
