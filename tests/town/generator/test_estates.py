import numpy as np
import pytest

from aug3d_core.town.config import TownConfig
from aug3d_core.town.generator.planning import make_plan
from aug3d_core.town.generator.roofs import paint_roof
from aug3d_core.town.generator.terrain import HILLS, terrain_of
from aug3d_core.town.generator.town import build_town, coloured_mesh


def test_towers_are_high_and_stand_apart():
    plan = make_plan(220, 130, np.random.default_rng(0), "high_rise")
    assert len(plan.buildings) > 10
    assert min(b.eaves_m for b in plan.buildings) > 20 > 55 - max(b.eaves_m for b in plan.buildings) - 5
    at = np.array([(b.frame.x, b.frame.y) for b in plan.buildings])
    apart = np.linalg.norm(at[:, None] - at, axis=-1) + 1e3 * np.eye(len(at))
    assert apart.min() > 17


def test_repeated_houses_are_alike_to_the_pixel():
    config = TownConfig(length_m=60, width_m=60, buildings="identical")
    plan = make_plan(60, 60, np.random.default_rng(0), "identical")
    assert len({(b.width_m, b.depth_m, b.eaves_m, b.pitch_deg) for b in plan.buildings}) == 1
    town = build_town(config, HILLS, np.random.default_rng(0))
    assert len({round(f.height_m, 6) for f in town.footprints}) == 1
    assert len(town.footprints) == len(plan.buildings) > 6
    colours = coloured_mesh(town).rgb[len(town.ground.vertices) :]
    house = next(n for n in range(50, 500) if (colours[:n] == colours[n : 2 * n]).all())
    of_each = colours[: house * len(plan.buildings)].reshape(len(plan.buildings), house, 3)
    assert (of_each == of_each[0]).all() and of_each[0].std() > 20


def test_a_bare_roof_has_one_colour():
    roof = paint_roof(8, 5, "bare", (0.5, 0.3, 0.2), 6, np.random.default_rng(0))
    assert roof.shape == (70, 112, 3)
    assert (roof == roof[0, 0]).all() and roof[0, 0].tolist() == [128, 76, 51]


@pytest.mark.parametrize("seed", [0, 1])
def test_nothing_stands_in_the_lake(seed):
    config = TownConfig(lake=True)
    land = terrain_of(config)
    plan = make_plan(config.length_m, config.width_m, np.random.default_rng(seed))
    before = len(plan.buildings), len(plan.trees)
    land.lake.flood(plan)
    assert len(plan.buildings) < before[0] and len(plan.trees) < before[1]
    for thing in (*(b.frame for b in plan.buildings), *plan.trees, *plan.cars):
        assert land.lake.beyond_m(np.array(thing.x), np.array(thing.y)) > 3
