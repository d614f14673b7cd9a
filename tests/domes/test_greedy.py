import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.domes.greedy import greedy

SETS = st.lists(st.lists(st.integers(0, 19), unique=True), max_size=8)


@given(
    SETS,
    st.lists(st.booleans(), min_size=20, max_size=20),
    st.lists(st.sampled_from([0.5, 1.0, 4.0]), min_size=20, max_size=20),
)
def test_each_set_is_the_one_that_adds_most_then(sets, before, worth):
    sets, covered, worth = [np.array(s, int) for s in sets], np.array(before), np.array(worth)
    seen, left = np.array(before), list(range(len(sets)))
    for index, gain in greedy(sets, covered, worth):
        gains = [sum(worth[e] for e in sets[i] if not seen[e]) for i in left]
        assert gain == max(gains) and index == left[int(np.argmax(gains))]
        seen[sets[index]] = True
        left.remove(index)
        np.testing.assert_array_equal(covered, seen)
    assert not left


def test_two_that_overlap_are_not_both_first():
    sets = [np.array([0, 1, 2, 3]), np.array([1, 2, 3, 4]), np.array([5, 6])]
    assert list(greedy(sets, np.zeros(7, bool), np.ones(7))) == [(0, 4), (2, 2), (1, 1)]


def test_few_elements_of_worth_come_before_many_of_little():
    sets = [np.array([0, 1, 2]), np.array([3])]
    assert [index for index, _ in greedy(sets, np.zeros(4, bool), np.array([1.0, 1.0, 1.0, 4.0]))] == [1, 0]
