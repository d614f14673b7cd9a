"""Rows by key are those that a look through all of them finds, in their order."""

from __future__ import annotations

import numpy as np
import pytest

from aug3d_core.geometry.rows import Rows


@pytest.mark.parametrize("keys", [[3], [0], [7], [5], [6, 2, 0], [], [*range(8)]])
def test_rows_that_have_keys_are_found_in_ascending_order(keys: list[int]) -> None:
    key_of_row = np.random.default_rng(0).choice([0, 1, 2, 3, 4, 6], 77)  # 5 and 7 have none
    found = Rows(key_of_row, 8).having(np.array(keys, int))
    assert found.tolist() == np.flatnonzero(np.isin(key_of_row, keys)).tolist()


def test_of_nothing_there_are_no_rows() -> None:
    assert Rows(np.zeros(0, int), 3).having(np.array([2])).tolist() == []
