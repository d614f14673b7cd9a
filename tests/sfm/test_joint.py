"""The weakest joint of a flight is found wherever it is, and however photographs and points are numbered."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.geometry.views import Tracks
from aug3d_core.sfm import joint as module
from aug3d_core.sfm.joint import Joint, weakest_joint

_OF_NEIGHBOURS = 40  # points that a photograph of the strip and the next one see


def strip(photos: int, gap: int, across: int, order: np.ndarray) -> Tracks:
    """Return a strip in which each photograph shares 40 points with the next, `across` of them at one place."""
    view, point, number = [], [], 0
    for one in range(photos - 1):
        for _ in range(across if one + 1 == gap else _OF_NEIGHBOURS):
            view += [order[one], order[one + 1]]
            point += [number, number]
            number += 1
    return Tracks(np.array(point), np.array(view), np.zeros((len(view), 2)))


@given(gap=st.integers(3, 17), across=st.integers(1, _OF_NEIGHBOURS - 1), order=st.permutations(range(20)))
def test_the_gap_is_the_weakest_joint(gap: int, across: int, order: list[int]) -> None:
    joint = weakest_joint(strip(20, gap, across, np.array(order)), 20)
    assert joint is not None
    assert (joint.points, joint.photos) == (across, min(gap, 20 - gap))
    assert joint.share == pytest.approx(across / (2 * _OF_NEIGHBOURS))


def test_points_that_several_pairs_share_count_once() -> None:
    of_all = Tracks(np.repeat(np.arange(5), 8), np.tile(np.arange(8), 5), np.zeros((40, 2)))
    joint = weakest_joint(of_all, 8)
    assert joint is None or (joint.points, joint.share) == (5, 1.0)


def test_photographs_at_the_rim_are_no_part() -> None:
    assert weakest_joint(strip(5, 2, 3, np.arange(5)), 5) is None


def flights(seed: int) -> tuple[Tracks, int]:
    """Return what some groups of photographs see, which have no point in common."""
    rng = np.random.default_rng(seed)
    photos, apart = int(rng.integers(2, 40)), int(rng.integers(1, 4))
    flight = rng.integers(0, apart, photos)
    point = rng.integers(0, 60, int(rng.integers(photos, 400)))
    view = rng.integers(0, photos, len(point))
    return Tracks(point * apart + flight[view], view, np.zeros((len(view), 2))), photos


@given(st.integers(0, 2**31))
def test_leaving_out_small_parts_changes_no_answer(seed: int) -> None:
    """Every edge is cut without it, and the joints of small parts are left out afterwards."""
    tracks, photos = flights(seed)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_smaller_parts", lambda tree: np.full(tree.nnz, photos))
        cut, found = module._cut, []
        patch.setattr(module, "_cut", lambda *given: found.append(cut(*given)) or found[-1])
        weakest_joint(tracks, photos)
    large = [joint for joint in found if joint.photos >= max(3, 0.1 * photos)]
    assert weakest_joint(tracks, photos) == min(large, key=lambda joint: joint.points, default=None)


def test_only_edges_between_large_parts_are_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    cut: list[int] = []
    monkeypatch.setattr(module, "_cut", lambda sees, tree, edge, typical: cut.append(edge) or Joint(edge, 3, 1.0))
    weakest_joint(strip(20, 10, 3, np.arange(20)), 20)
    assert len(set(cut)) == len(cut) == 19 - 4, "two at each end of the strip"
