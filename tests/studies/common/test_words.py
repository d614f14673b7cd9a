"""What is picked by words begins with them somewhere in its name; words that nothing begins with are named."""

from __future__ import annotations

import pytest

from aug3d_core.run.errors import UsageError
from aug3d_core.studies.common.words import picked

NAMES = ("render samples", "samples on a ray", "domes of virtual views")


def test_words_are_found_where_a_word_begins() -> None:
    assert picked("panel", NAMES, ["SAMPLES", "dom"]) == set(NAMES)
    assert picked("panel", NAMES, ["on a ray"]) == {NAMES[1]}
    assert picked("panel", NAMES, []) == set(NAMES)


def test_words_that_are_nowhere_are_named_though_others_are_found() -> None:
    with pytest.raises(UsageError, match=r"no panel 'amples'.*\n.*render samples; samples on a ray"):
        picked("panel", NAMES, ["domes", "amples"])


def test_no_words_at_all_pick_nothing_and_many_are_not_repeated() -> None:
    with pytest.raises(UsageError, match="no panel ''"):
        picked("panel", NAMES, [""])
    with pytest.raises(UsageError) as told:
        picked("panel", NAMES, ["x" * 10_000])
    assert len(str(told.value)) < 300
