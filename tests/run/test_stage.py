"""Who helps takes the shards in an order of their own: all of them, and those that the owner is about to make, last."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.run.stage import from_elsewhere


@given(st.integers(0, 9))
def test_all_shards_are_taken_each_before_the_one_that_precedes_it(count: int) -> None:
    order = from_elsewhere(range(count))
    assert sorted(order) == [*range(count)]
    assert all((first - second) % count == 1 % count for first, second in pairwise(order))


def test_several_who_help_begin_at_several_places() -> None:
    assert len({from_elsewhere(range(100))[0] for _ in range(20)}) > 5
