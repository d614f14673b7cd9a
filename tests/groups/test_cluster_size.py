"""K by itself is the largest at which members still overlap, and it says why."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from aug3d_core.groups.cluster_size import cluster_size


def clusters(count: int, size: int, alike: float = 0.4) -> sparse.csr_array:
    """Return the similarities of views in clusters that share nothing with each other."""
    return sparse.csr_array(np.kron(np.eye(count), np.full((size, size), alike) + (1 - alike) * np.eye(size)))


@pytest.mark.parametrize("size", [4, 6, 9])
def test_clusters_are_found_whole(size: int) -> None:
    k, reason = cluster_size(clusters(4, size), np.arange(4 * size))
    assert k == size
    assert f"with {size + 1} it would be" in reason


def test_three_are_looked_from_and_one_is_predicted_however_few_overlap() -> None:
    k, reason = cluster_size(clusters(4, 3), np.arange(12))
    assert k == 4
    assert reason == "33% of the members do not overlap with their centre, but fewer leave none to predict"
    assert cluster_size(clusters(1, 3), np.arange(3)) == (3, "there are 3 views")


def test_ten_is_the_most() -> None:
    k, reason = cluster_size(clusters(2, 40), np.arange(80))
    assert k == 10
    assert "more than the paper's 10 made models worse" in reason


def test_no_more_than_there_are() -> None:
    assert cluster_size(clusters(1, 12), np.arange(7)) == (7, "there are 7 views")


def test_only_candidates_count() -> None:
    assert cluster_size(clusters(4, 12), np.arange(0, 48, 2))[0] == 6


@pytest.mark.parametrize("alike", [0.0, 0.04])
def test_where_nothing_overlaps_pairs_are_made(alike: float) -> None:
    assert cluster_size(clusters(3, 5, alike), np.arange(15)) == (2, "no two views overlap")
