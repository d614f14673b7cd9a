"""The large scene is what it says, and its figures are measured."""

from __future__ import annotations

import numpy as np
import pytest

from aug3d_core.bench.big_scene import big_scene
from aug3d_core.bench.city import grouping_seconds, similarity_cost
from aug3d_core.geometry.transforms import apply, project
from aug3d_core.groups.methods import METHODS


def test_the_flight_is_as_large_as_asked() -> None:
    views, points, tracks = big_scene(900, 200_000)
    assert len(views) == pytest.approx(900, rel=0.05)
    assert len(tracks.view) == pytest.approx(200_000, rel=0.08)
    assert len(set(zip(tracks.view.tolist(), tracks.point.tolist(), strict=True))) == len(tracks.view)
    assert np.bincount(tracks.point, minlength=len(points.xyz)).mean() == pytest.approx(4.6, abs=0.3)


def test_points_lie_in_the_photographs_that_see_them() -> None:
    views, points, tracks = big_scene(200, 20_000)
    for view in (0, 57, len(views) - 1):
        seen = points.xyz[tracks.point[tracks.view == view]]
        xy = project(apply(views.cam_from_world[view], seen), views.intrinsics[view])
        assert len(xy) > 10
        assert ((xy > -20) & (xy < views.size[view] + 20)).all()  # the ground's roughness moves those at the rim


def test_costs_are_measured() -> None:
    seconds, peak_mib = similarity_cost(200, 20_000)
    assert 0 < seconds < 5
    assert peak_mib > 10
    assert set(grouping_seconds(400, 50_000)) == set(METHODS)
