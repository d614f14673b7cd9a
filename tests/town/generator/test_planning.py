import numpy as np
import pytest

from aug3d_core.town.generator.plan import MARGIN_M, Building, Ground, Plan
from aug3d_core.town.generator.planning import make_plan


@pytest.fixture(scope="module", params=[0, 7, 11])
def plan(request) -> Plan:
    return make_plan(220.0, 130.0, np.random.default_rng(request.param))


def corners(b: Building, inset: float = 0.02) -> np.ndarray:
    x, y = b.width_m / 2 - inset, b.depth_m / 2 - inset
    return b.frame.place(np.array([(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)]))[:, :2]


def apart(a: np.ndarray, b: np.ndarray) -> bool:
    """Tell whether an edge of one of two convex outlines separates them."""
    for one, other in ((a, b), (b, a)):
        edges = np.roll(one, -1, axis=0) - one
        outward = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
        if any(((other - p) @ n > 0).all() for p, n in zip(one, outward, strict=True)):
            return True
    return False


def test_buildings_do_not_stand_in_each_other(plan):
    outlines = [corners(b) for b in plan.buildings]
    for i, a in enumerate(outlines):
        assert all(apart(a, b) for b in outlines[:i])


def test_nothing_stands_on_the_streets(plan):
    """The long bands of asphalt that reach into the country are the streets."""
    streets = [np.array(c) for ground, c in plan.paint if ground == Ground.ASPHALT and np.ptp(c, axis=0).max() > 220]
    assert streets
    outlines = [corners(b) for b in plan.buildings] + [np.array(h.corners) for h in plan.hedges]
    outlines += [np.array([[t.x, t.y], [t.x + 0.1, t.y], [t.x, t.y + 0.1]]) for t in plan.trees]
    for outline in outlines:
        assert all(apart(outline, street) for street in streets)


def test_everything_stands_on_the_ground(plan):
    reach = np.array([110.0 + MARGIN_M, 65.0 + MARGIN_M])
    for thing in (*plan.trees, *plan.cars):
        assert (np.abs([thing.x, thing.y]) < reach).all()
    assert {"gable", "hip", "flat"} == {b.roof for b in plan.buildings}
    assert len({round(b.eaves_m) for b in plan.buildings}) >= 5, "buildings of several heights"
    assert len(plan.buildings) > 30 and len(plan.cars) > 40 and len(plan.trees) > 100


def test_the_same_seed_gives_the_same_plan():
    a, b = (make_plan(90.0, 70.0, np.random.default_rng(4)) for _ in range(2))
    assert a == b != make_plan(90.0, 70.0, np.random.default_rng(5))
