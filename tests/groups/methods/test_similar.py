"""Groups by similarity: hubs, twins and lonely views."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from aug3d_core.geometry.views import Tracks, Views
from aug3d_core.groups.methods.shared_points import likeness
from aug3d_core.groups.methods.similar import group_by, lonely, most_similar
from aug3d_core.groups.scene import GroupingScene
from tests.groups.strip_scene import fly, scene_of

EVERY = np.arange(24)


def hovering(times: int) -> tuple[GroupingScene, np.ndarray]:
    """Return a flight whose view 6 was taken several times over, and the views of that one pose."""
    views, points, tracks = fly(24, 1500)
    copies = np.concatenate([EVERY, np.full(times - 1, 6)])
    seen = [(tracks.point[tracks.view == view], number) for number, view in enumerate(copies)]
    point = np.concatenate([p for p, _ in seen])
    view = np.concatenate([np.full(len(p), number) for p, number in seen])
    taken = views.take(copies)
    renamed = Views(np.arange(len(copies)), taken.cam_from_world, taken.intrinsics, taken.size)
    scene = scene_of(renamed, points, Tracks(point, view, np.zeros((len(view), 2))))
    return scene, np.append(6, np.arange(24, 24 + times - 1))


def test_of_views_in_one_pose_one_is_in_a_group_while_there_are_others() -> None:
    scene, same = hovering(5)
    everyone = np.arange(len(scene.views))
    for row in group_by(likeness(scene), scene, everyone, 5, 28):
        assert np.isin(row, same).sum() <= 1


def test_twins_come_before_views_that_see_something_else() -> None:
    scene, same = hovering(5)
    row = most_similar(likeness(scene), scene, 6, np.append(same, [0, 11]), 6)
    assert set(row[:5]) == set(same)


def test_a_hub_that_sees_everything_is_not_in_every_group() -> None:
    views, points, tracks = fly(24, 3000)
    hub = np.arange(len(points.xyz))
    point, view = np.append(tracks.point, hub), np.append(tracks.view, np.full(len(hub), 24))
    more = views.take(np.append(EVERY, 12))
    more = Views(np.arange(25), more.cam_from_world, more.intrinsics, more.size)
    scene = scene_of(more, points, Tracks(point, view, np.zeros((len(view), 2))))
    assert (scene.shared.toarray()[24, :24] == scene.shared.diagonal()[:24]).all()
    members = group_by(likeness(scene), scene, np.arange(25), 4, 25)
    assert (members[members[:, 0] != 24] == 24).any(axis=1).mean() < 0.2


def test_a_view_that_shares_nothing_is_lonely_and_no_centre() -> None:
    views, points, tracks = fly(24, 1500)
    keep = tracks.view != 3
    scene = scene_of(views, points, Tracks(tracks.point[keep], tracks.view[keep], tracks.xy[keep]))
    assert lonely(likeness(scene), EVERY, 4).tolist() == [3]
    assert 3 not in group_by(likeness(scene), scene, EVERY, 4, 24)


def test_where_all_are_lonely_groups_are_made_all_the_same() -> None:
    scene = scene_of(*fly(24, 1500, length_m=20_000.0))
    assert len(lonely(likeness(scene), EVERY, 12)) == 24
    assert len(group_by(likeness(scene), scene, EVERY, 12, 24)) == 24


def test_a_view_at_the_edge_is_a_member_and_no_centre() -> None:
    """The ends of the flight overlap with few: groups around others hold them too."""
    scene = scene_of(*fly(40, 3000))
    everyone, k = np.arange(40), 12
    members = group_by(likeness(scene), scene, everyone, k, 40)
    assert set(members.ravel()) == set(range(40))
    assert (scene.shared_share.toarray()[members[:, :1], members] >= likeness(scene).overlaps).all()
    assert not np.isin([0, 19, 20, 39], members[:, 0]).any()


def test_a_view_that_no_other_takes_is_a_centre_if_half_of_its_group_overlaps() -> None:
    """Two clusters, of 12 and of 4 views: with K = 6 the small one makes a group too, filled up; with K = 12 it cannot."""
    views, points, _ = fly(24, 1500)
    share = np.kron(np.eye(2), np.ones((12, 12)))[:16, :16] * 1000
    scene = GroupingScene(views.take(np.arange(16)), sparse.csr_array(share), np.zeros((16, 2)), points.xyz)
    assert 12 in group_by(likeness(scene), scene, np.arange(16), 6, 16)
    assert 12 not in group_by(likeness(scene), scene, np.arange(16), 12, 16)
    assert lonely(likeness(scene), np.arange(16), 12).tolist() == [12, 13, 14, 15]
