"""Figures of groups whose overlaps and shared points are written down by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

from aug3d_core.overlap.measures import jaccard, measure, pairs_within
from aug3d_core.overlap.pair_overlaps import PairOverlaps, bad_share, pair_keys


def overlaps(values: dict[tuple[int, int], float], views: int) -> PairOverlaps:
    pairs = np.array(sorted(values))
    return PairOverlaps(views, pair_keys(pairs[:, 0], pairs[:, 1], views), np.array([values[tuple(p)] for p in pairs]))


SHARED = sparse.csr_array(np.array([[9, 4, 0, 2], [4, 9, 1, 0], [0, 1, 9, 3], [2, 0, 3, 9]], np.int32))
ALL = overlaps({(0, 1): 0.5, (0, 2): 0.05, (0, 3): np.nan, (1, 2): 0.1, (1, 3): 0.0, (2, 3): 0.3}, 4)


def test_figures_by_hand() -> None:
    figures = measure(np.array([[0, 1, 2], [3, 2, 1]]), SHARED, ALL, 5)
    assert figures["shared_points_mean"] == pytest.approx((4 + 0 + 3 + 0) / 4)
    assert figures["shared_points_min"] == 0
    assert figures["bad_members_share"] == pytest.approx(2 / 4)  # 0-2 and 3-1; exactly 10 % is not bad
    assert figures["bad_pairs_share"] == pytest.approx(2 / 6)
    assert figures["coverage"] == pytest.approx(4 / 5)
    assert figures["jaccard_mean"] == figures["jaccard_max"] == pytest.approx(2 / 4)


def test_what_cannot_be_judged_is_neither_good_nor_bad() -> None:
    figures = measure(np.array([[0, 3], [2, 3]]), SHARED, ALL, 4)
    assert figures["bad_members_share"] == 0.0
    assert figures["unjudged_share"] == 0.5
    assert measure(np.array([[0, 3]]), SHARED, ALL, 4)["bad_members_share"] is None
    assert bad_share(np.array([])) is None


def test_one_group_alone_is_like_no_other() -> None:
    figures = measure(np.array([[0, 1, 2]]), SHARED, ALL, 4)
    assert figures["jaccard_mean"] is None and figures["jaccard_max"] is None


def test_a_pair_that_was_not_measured_is_an_error() -> None:
    some = overlaps({(0, 1): 0.5, (1, 2): 0.25}, 4)
    assert some.of(np.array([2]), np.array([1])) == 0.25, "whichever comes first"
    for a, b in ((0, 2), (2, 3)):
        with pytest.raises(KeyError, match="not measured"):
            some.of(np.array([a]), np.array([b]))


def test_joined_pairs_keep_their_values() -> None:
    both = overlaps({(0, 1): 0.5}, 4).joined(overlaps({(0, 1): 0.5, (2, 3): 0.25}, 4))
    assert both.of(np.array([0, 3]), np.array([1, 2])).tolist() == [0.5, 0.25]


@given(st.integers(1, 6), st.integers(2, 5), st.integers(0, 99))
def test_jaccard_is_that_of_sets_and_pairs_are_all_pairs(count: int, k: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    members = np.stack([rng.permutation(8)[:k] for _ in range(count)])
    alike = jaccard(members, 8)
    for i, one in enumerate(members):
        for j, other in enumerate(members):
            common, either = set(one) & set(other), set(one) | set(other)
            assert alike[i, j] == pytest.approx(len(common) / len(either))
    assert len(pairs_within(members)) == count * k * (k - 1) // 2
