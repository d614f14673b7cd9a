"""A footprint is the side of the square of ground that a view sees."""

from __future__ import annotations

import numpy as np
import pytest

from aug3d_core.geometry.footprint import footprints, footprints_apart
from aug3d_core.geometry.views import Tracks
from tests.groups.strip_scene import fly, scene_of


def test_ground_seen_evenly_has_the_footprint_of_a_square_of_its_area() -> None:
    flight = fly(points=20_000)
    found = footprints(flight[2], flight[1].xyz, scene_of(*flight).look_in_world)
    # A strip's views see 80 m along it and 65 m across, those at its ends half as much
    np.testing.assert_allclose(found[2:17], np.sqrt(80 * 65), rtol=0.05)


def test_a_few_far_points_do_not_make_a_footprint_larger() -> None:
    views, points, tracks = fly()
    look = scene_of(views, points, tracks).look_in_world
    far = points.xyz.copy()
    far[:30] += 1e5
    usual = footprints(tracks, points.xyz, look)
    assert footprints(tracks, far, look) == pytest.approx(usual, rel=0.1)


def test_a_blind_view_has_the_median_footprint() -> None:
    views, points, tracks = fly()
    look, keep = scene_of(views, points, tracks).look_in_world, tracks.view != 7
    found = footprints(Tracks(tracks.point[keep], tracks.view[keep], tracks.xy[keep]), points.xyz, look)
    assert found[7] == np.median(np.delete(found, 7))


def test_squares_side_by_side_are_one_footprint_apart() -> None:
    look, footprint = np.array([[0.0, 0.0], [6.0, 0.0], [0.0, 0.0]]), np.array([4.0, 8.0, 0.0])
    apart = footprints_apart(look, footprint, np.array([0]), np.array([0, 1]))
    np.testing.assert_allclose(apart, [[0, 1]])
    assert footprints_apart(look, 0 * footprint, np.array([0]), np.array([2]))[0, 0] == 0
