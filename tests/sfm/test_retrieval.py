"""Photographs of one place have vectors that are alike, whatever else is in them; the same on any number of threads."""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits

from aug3d_core.sfm.retrieval import candidates, vectors

PLACES, SEEN, SHARED = 40, 120, 40


def flight(photos: int, seed: int = 0) -> list[np.ndarray]:
    """Return descriptors of photographs along a line: each shares a third of its features with the next, a little changed."""
    rng = np.random.default_rng(seed)
    kinds = rng.gamma(0.5, size=(30, 128))  # much is of the same kind: windows, leaves
    scene = kinds[rng.integers(30, size=(photos + 2) * SHARED)] + rng.gamma(0.5, size=((photos + 2) * SHARED, 128))
    seen = []
    for at in range(photos):
        own = scene[at * SHARED : at * SHARED + SEEN] + rng.normal(0, 0.1, (SEEN, 128))
        own = np.maximum(own, 0)
        seen.append(np.rint(512 * own / np.linalg.norm(own, axis=1, keepdims=True)).clip(0, 255).astype(np.uint8))
    return seen


def quiet(done: int, total: int, what: str) -> None:
    """Report to nobody."""


def test_those_that_share_most_come_first() -> None:
    found = candidates(vectors(flight(PLACES), 0, quiet), np.arange(PLACES), 2)
    apart = np.abs(found[:, 0] - found[:, 1])
    assert (apart == 1).mean() > 0.9


def test_nobody_is_its_own_candidate_and_all_others_are_where_they_are_few() -> None:
    found = candidates(vectors(flight(5), 0, quiet), np.array([1, 3]), 50)
    assert sorted(map(tuple, found.tolist())) == [(i, j) for i in (1, 3) for j in range(5) if i != j]


def test_products_are_exact_in_single_precision() -> None:
    found = vectors(flight(PLACES), 0, quiet).astype(np.int64)
    exact = found @ found.T
    assert exact.max() < 2**24
    np.testing.assert_array_equal(found.astype(np.float32) @ found.astype(np.float32).T, exact)


def test_any_number_of_threads_gives_the_same_vectors() -> None:
    for threads in (1, 2):
        with threadpool_limits(threads):
            found = vectors(flight(PLACES), 3, quiet)
        np.testing.assert_array_equal(found, vectors(flight(PLACES), 3, quiet))


def test_photographs_without_features_are_like_nothing() -> None:
    none = np.zeros((0, 128), np.uint8)
    found = vectors([none, *flight(3), none], 0, quiet)
    assert not found[0].any() and found[1].any()
    assert not vectors([none, none], 0, quiet).any()
    assert candidates(found, np.array([1]), 1)[0, 1] == 2
