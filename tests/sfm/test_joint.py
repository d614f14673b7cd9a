"""The weakest joint of a flight is found wherever it is, and however photographs and points are numbered."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.geometry.views import Tracks
from aug3d_core.sfm.joint import weakest_joint

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
