"""The ground is found under what stands on it, by the simplest surface that fits, and rays meet it where it is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aug3d_core.geometry.ground_model import GroundModel, fit_ground
from aug3d_core.run.errors import InputError
from aug3d_core.town.generator.terrain import Terrain

Height = Callable[[np.ndarray], np.ndarray]


def level(xy: np.ndarray) -> np.ndarray:
    return np.full(len(xy), 4.0)


def tilted(xy: np.ndarray) -> np.ndarray:
    return 0.176 * xy[:, 1] - 0.05 * xy[:, 0] + 4


def hills(xy: np.ndarray) -> np.ndarray:
    return Terrain().height(xy[:, 0], xy[:, 1])


def built_on(height: Height, points: int = 8000, seed: int = 0, noise: float = 0.05) -> np.ndarray:
    """Return points on 200 x 140 of ground with nine blocks of houses (a fifth of the area), trees and strays below."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform([-100, -70], [100, 70], (points, 2))
    z = height(xy) + rng.normal(0, noise, points)
    for x in (-60, 0, 60):
        for y in (-40, 0, 40):
            z[(np.abs(xy - [x, y]) < [15, 11]).all(axis=1)] += rng.uniform(4, 20)
    tree, stray = rng.random(points) < 0.1, rng.random(points) < 0.01
    z[tree] += rng.uniform(1, 8, tree.sum())
    z[stray] -= rng.uniform(2, 100, stray.sum())
    return np.column_stack([xy, z])


def fit(points: np.ndarray) -> GroundModel:
    return fit_ground(points, np.random.default_rng(0))


def off(model: GroundModel, height: Height, inside: float = 0.95) -> np.ndarray:
    x, y = np.meshgrid(np.linspace(-100, 100, 41) * inside, np.linspace(-70, 70, 31) * inside)
    places = np.column_stack([x.ravel(), y.ravel()])
    return np.abs(model.height_at(places) - height(places))


@pytest.mark.parametrize(("height", "kind", "most_m"), [(level, "level", 0.1), (tilted, "tilted", 0.25)])
def test_planes_are_found_under_houses_trees_and_strays(height: Height, kind: str, most_m: float) -> None:
    model = fit(built_on(height))
    assert model.kind == kind
    assert off(model, height).max() < most_m


def test_hills_are_followed_under_houses_trees_and_strays() -> None:
    model = fit(built_on(hills))
    assert model.kind == "smooth"
    assert np.percentile(off(model, hills), 95) < 0.5
    assert model.error < 0.4


@pytest.mark.parametrize(("height", "kind"), [(level, "level"), (tilted, "tilted"), (hills, "smooth")])
def test_bare_ground_is_met_exactly_or_within_the_splines_reach(height: Height, kind: str) -> None:
    xy = np.random.default_rng(1).uniform([-100, -70], [100, 70], (6000, 2))
    model = fit(np.column_stack([xy, height(xy)]))
    assert model.kind == kind
    assert off(model, height).max() < (0.4 if kind == "smooth" else 1e-6)


@settings(max_examples=4, deadline=None)
@given(st.floats(0.01, 100), st.floats(-1e3, 1e3))
def test_units_and_origin_do_not_matter(scale: float, shift: float) -> None:
    points = built_on(tilted, 3000)
    model, moved = fit(points), fit(points * scale + shift)
    places = points[::50, :2]
    assert moved.kind == model.kind
    np.testing.assert_allclose(
        moved.height_at(places * scale + shift), model.height_at(places) * scale + shift, 0, scale
    )


def test_the_same_points_give_the_same_ground() -> None:
    points = built_on(hills, 3000)
    np.testing.assert_array_equal(fit(points).height_at(points[:, :2]), fit(points).height_at(points[:, :2]))


@pytest.mark.parametrize("height", [level, tilted, hills])
def test_rays_from_above_end_on_the_ground(height: Height) -> None:
    model = fit(built_on(height))
    rng = np.random.default_rng(2)
    origins = np.column_stack([rng.uniform(-80, 80, (50, 2)), np.full(50, 60.0)])
    directions = np.column_stack([rng.uniform(-1, 1, (50, 2)), np.full(50, -1.0)])
    distance = model.meet(origins, directions)
    ends = origins + distance[:, None] * directions
    assert (distance > 0).all()
    np.testing.assert_allclose(model.height_at(ends[:, :2]), ends[:, 2], atol=1e-6)


def test_a_ray_meets_the_near_side_of_a_hill() -> None:
    """A plane would let it through: the hill is 10 high, the ray sinks from 8 above the plain towards it."""
    xy = np.random.default_rng(3).uniform(-100, 100, (8000, 2))
    hill = 10 * np.exp(-(xy[:, 0] ** 2 + xy[:, 1] ** 2) / (2 * 50**2))
    model = fit(np.column_stack([xy, hill]))
    assert model.kind == "smooth"
    distance = model.meet(np.array([[-95.0, 0.0, 8.0]]), np.array([[1.0, 0.0, -0.02]]))
    assert 50 < distance[0] < 80


@pytest.mark.parametrize("height", [level, tilted, hills])
def test_rays_upward_and_from_below_meet_nothing(height: Height) -> None:
    model = fit(built_on(height, 3000))
    origins = np.array([[0.0, 0.0, 60.0], [0.0, 0.0, -60.0]])
    directions = np.array([[0.0, 0.3, 1.0], [0.3, 0.0, -1.0]])
    np.testing.assert_array_equal(model.meet(origins, directions), np.inf)


def test_a_level_ray_over_level_ground_meets_nothing() -> None:
    model = fit(built_on(level, 3000))
    assert model.meet(np.array([[0.0, 0.0, 60.0]]), np.array([[1.0, 0.0, 0.0]]))[0] == np.inf


def test_beyond_the_points_the_rim_goes_on() -> None:
    model = fit(built_on(hills, 3000))
    far = np.array([[1e4, 0.0], [-1e4, 1e4]])
    assert np.isfinite(model.height_at(far)).all()


def tower(points: int = 4000) -> np.ndarray:
    """Return the four walls and the roof of a tower of 20 x 20 x 80."""
    rng = np.random.default_rng(4)
    along, up, wall = rng.uniform(-10, 10, points), rng.uniform(10, 80, points), rng.integers(0, 5, points)
    x = np.choose(wall, [along, along, -10, 10, along])
    y = np.choose(wall, [-10, 10, along, along, rng.uniform(-10, 10, points)])
    return np.column_stack([x, y, np.where(wall == 4, 80.0, up)])


@pytest.mark.parametrize("points", [tower(), tower()[tower()[:, 2] < 79]])
def test_a_tower_alone_has_no_ground(points: np.ndarray) -> None:
    with pytest.raises(InputError, match="no ground is to be found"):
        fit(points)


@pytest.mark.parametrize("count", [0, 1, 10])
def test_a_handful_of_points_is_no_ground(count: int) -> None:
    with pytest.raises(InputError, match="no ground is to be found"):
        fit(built_on(level)[:count])
