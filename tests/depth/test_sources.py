from __future__ import annotations

import numpy as np

from aug3d_core.depth.sources import BEST_DEG, angle_weight, choose_sources
from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Points, Tracks, Views

ALL = np.ones(5, bool)


def row_of_views(east: list[float], height: float = 50.0) -> tuple[Views, Points, Tracks]:
    """Views that look straight down from places along a line, and ground points that all of them see."""
    xyz = np.column_stack([np.linspace(-2, 2, 20), np.zeros(20), np.zeros(20)])
    count = len(east)
    views = Views(
        photo_id=np.arange(count) + 100,
        cam_from_world=np.stack([look_at(np.array([x, 0, height]), np.array([x, 0, 0.0])) for x in east]),
        intrinsics=np.tile([100.0, 100.0, 64.0, 48.0], (count, 1)),
        size=np.tile([128, 96], (count, 1)),
    )
    points = Points(xyz, np.zeros((20, 3), np.uint8), np.zeros(20))
    tracks = Tracks(np.repeat(np.arange(20), count), np.tile(np.arange(count), 20), np.zeros((20 * count, 2)))
    return views, points, tracks


def at(angle_deg: float) -> float:
    return 50 * np.tan(np.radians(angle_deg))


def test_the_weight_is_one_at_the_best_angle_and_falls_faster_towards_none() -> None:
    assert angle_weight(np.array([BEST_DEG]))[0] == 1.0
    below, above = angle_weight(np.array([BEST_DEG - 8, BEST_DEG + 8]))
    assert below < above < 1


def test_a_good_angle_comes_before_a_tiny_and_a_huge_one() -> None:
    scene = row_of_views([0.0, at(1), at(12), at(45), at(20)])
    chosen = choose_sources(*scene, given=ALL, train=ALL, most=4)
    assert chosen[0][:2] == [2, 4]
    assert len(chosen[0]) == 4


def test_a_train_view_takes_only_train_views_and_no_target_is_taken() -> None:
    scene = row_of_views([0.0, at(5), at(10), at(15), at(20)])
    train, given = np.array([1, 0, 1, 0, 0], bool), np.array([1, 1, 1, 1, 0], bool)
    chosen = choose_sources(*scene, given=given, train=train, most=4)
    assert sorted(chosen) == [0, 1, 2, 3]
    assert chosen[0] == [2]
    assert set(chosen[1]) == {0, 2, 3}


def test_the_order_of_the_observations_is_nothing_to_it() -> None:
    views, points, tracks = row_of_views([0.0, at(5), at(10), at(15), at(20)])
    order = np.random.default_rng(0).permutation(len(tracks.view))
    mixed = Tracks(tracks.point[order], tracks.view[order], tracks.xy[order])
    chosen = choose_sources(views, points, mixed, given=ALL, train=ALL, most=4)
    assert chosen == choose_sources(views, points, tracks, given=ALL, train=ALL, most=4)


def test_a_view_that_shares_too_little_has_no_source() -> None:
    views, points, tracks = row_of_views([0.0, at(5), at(10), at(15), at(20)])
    kept = (tracks.view != 4) | (tracks.point < 7)
    chosen = choose_sources(
        views, points, Tracks(tracks.point[kept], tracks.view[kept], tracks.xy[kept]), given=ALL, train=ALL, most=4
    )
    assert chosen[4] == []
    assert all(4 not in sources for sources in chosen.values())


def test_a_view_without_a_source_is_the_source_of_none() -> None:
    """The first is for training and overlaps with the second alone, which is not; the second has no other source."""
    views, points, tracks = row_of_views([0.0, at(5), at(10), at(15), at(20)])
    kept = np.where(tracks.point < 10, tracks.view < 2, tracks.view > 1)
    train = np.array([1, 0, 1, 1, 0], bool)
    chosen = choose_sources(
        views, points, Tracks(tracks.point[kept], tracks.view[kept], tracks.xy[kept]), given=ALL, train=train, most=4
    )
    assert chosen[0] == chosen[1] == []
    assert {view: set(sources) for view, sources in chosen.items() if sources} == {2: {3}, 3: {2}, 4: {2, 3}}
