"""The coarse comparison counts what two photographs have in common, exactly and whatever their order."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from aug3d_core.sfm.coarse import common, comparer, largest


def descriptors(count: int, seed: int) -> np.ndarray:
    """Return random descriptors of COLMAP's length, 512."""
    raw = np.random.default_rng(seed).exponential(size=(count, 128))
    return np.round(512 * raw / np.linalg.norm(raw, axis=1, keepdims=True)).clip(0, 255).astype(np.uint8)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 40), st.integers(0, 1000))
def test_what_is_shared_is_counted(shared: int, seed: int) -> None:
    same = descriptors(shared, seed)
    first = np.concatenate([same, descriptors(50, seed + 1)]).astype(np.float32)
    second = np.concatenate([descriptors(60, seed + 2), same[::-1]]).astype(np.float32)
    assert shared <= common(first, second) <= shared + 2
    assert shared <= common(second, first) <= shared + 2


def test_a_feature_that_occurs_twice_is_not_counted() -> None:
    once = descriptors(20, 0).astype(np.float32)
    assert common(once, once) == 20
    assert common(once, np.concatenate([once, once])) == 0


def test_photographs_without_features_share_nothing() -> None:
    none, some = np.zeros((0, 128), np.float32), descriptors(9, 0).astype(np.float32)
    assert common(none, some) == common(some, none) == common(none, none) == common(some[:1], some) == 0


def test_products_are_whole_numbers_in_any_order() -> None:
    first, second = descriptors(256, 1), descriptors(256, 2)
    exact = first.astype(np.int64) @ second.astype(np.int64).T
    np.testing.assert_array_equal(first.astype(np.float32) @ second.astype(np.float32).T, exact)
    brightest = np.full((1, 128), 255, np.float32)
    assert (brightest @ brightest.T)[0, 0] == 128 * 255**2 < 2**24


def test_the_largest_features_are_kept_among_equals_the_first() -> None:
    found = np.repeat(np.arange(5, dtype=np.uint8)[:, None], 128, axis=1)
    np.testing.assert_array_equal(largest(found, np.array([1.0, 3, 2, 3, 1]), 3)[:, 0], [1, 3, 2])
    assert len(largest(found, np.arange(5.0), 9)) == 5


def test_all_pairs_are_scored_and_progress_is_told() -> None:
    told: list[tuple[int, int, str]] = []
    photos = [descriptors(8, 0), descriptors(8, 1), descriptors(8, 0)]
    scores = comparer(photos, lambda *at: told.append(at))(np.array([[0, 1], [0, 2], [1, 2]]))
    np.testing.assert_array_equal(scores, [0, 8, 0])
    assert told == [(3, 3, "pairs of photographs ranked")]
