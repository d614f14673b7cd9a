"""Which training photographs others make spare."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

from aug3d_core.groups.spare import MOST_SHOWN, spare_views

NONE = np.empty(0, int)


def seen_by(*parts: list[int]) -> sparse.csr_array:
    """Return views x parts of the surface."""
    seen = np.zeros((len(parts), 30))
    for view, own in enumerate(parts):
        seen[view, own] = 0.5
    return sparse.csr_array(seen)


def test_of_photographs_that_show_the_same_as_many_stay_as_are_enough() -> None:
    seen = seen_by(*[list(range(10))] * 8)
    for enough in (1, 3, 7):
        assert len(spare_views(seen, np.arange(8), NONE, enough)) == 8 - enough
    assert not len(spare_views(seen, np.arange(8), NONE, 8))


def test_what_shows_a_place_of_its_own_stays() -> None:
    seen = seen_by([*range(10)], [*range(10)], [*range(8), 20, 21])
    assert spare_views(seen, np.arange(3), NONE, 1).tolist() == [0], (
        "2 shows a fifth alone; then 1 is needed for 8 and 9"
    )


def test_only_candidates_count_and_those_that_show_nothing_stay() -> None:
    seen = seen_by(*[list(range(10))] * 4, [])
    assert not len(spare_views(seen, np.array([1, 4]), NONE, 1)), "0, 2 and 3 are not for training; 4 shows nothing"
    assert not len(spare_views(seen, NONE, NONE, 1))


def test_what_stays_in_any_case_counts() -> None:
    seen = seen_by(*[list(range(10))] * 4)
    assert spare_views(seen, np.array([0]), np.array([1, 2]), 2).tolist() == [0]
    assert not len(spare_views(seen, np.array([0]), np.array([1]), 2))


@given(st.integers(0, 2**31), st.integers(1, 4))
@pytest.mark.parametrize("views", [1, 6, 12])
def test_enough_show_what_is_left_out(views: int, seed: int, enough: int) -> None:
    """Each view that is left out: enough of those that stay show nine tenths of its surface."""
    rng = np.random.default_rng(seed)
    seen = seen_by(*[rng.choice(20, rng.integers(0, 20), replace=False).tolist() for _ in range(views)])
    spare = spare_views(seen, np.arange(views), NONE, enough)
    shown = (seen[np.setdiff1d(np.arange(views), spare)] > 0).sum(axis=0)
    for view in spare:
        assert np.mean(shown[seen[[view]].indices] >= enough) >= MOST_SHOWN
