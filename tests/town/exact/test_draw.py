"""Towns by number: each is its own, whatever else is drawn, and of every kind."""

import numpy as np

from aug3d_core.town.drone.flight import plan_flight
from aug3d_core.town.exact.draw import drawn_town
from aug3d_core.town.generator.terrain import terrain_of


def test_a_town_depends_on_its_number_alone():
    assert drawn_town(0, 7, 256) == drawn_town(0, 7, 256)
    others = [drawn_town(0, 8, 256), drawn_town(1, 7, 256)]
    assert all(drawn_town(0, 7, 256) != other for other in others)


def test_they_are_of_every_kind():
    towns = [drawn_town(0, number, 256).town for number in range(150)]
    for field, least in {"buildings": 6, "terrain": 3, "season": 4, "path": 6, "focal_35mm": 12}.items():
        assert len({getattr(town, field) for town in towns}) >= least, field
    heights = [town.altitude_m for town in towns]
    assert min(heights) < 50 and max(heights) > 100


def test_every_flight_fills_a_group():
    for number in range(60):
        config = drawn_town(0, number, 256)
        flight_rng = np.random.default_rng(config.town.seed).spawn(4)[1]
        assert len(plan_flight(config.town, flight_rng, terrain_of(config.town))) >= config.k
