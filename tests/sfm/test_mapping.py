"""How photographs are mapped does not hang on a few of them."""

from __future__ import annotations

import pytest

from aug3d_core.sfm.mapping import choose_mapper


@pytest.mark.parametrize(
    ("photos", "unknown", "mapper"),
    [(250, 250, "incremental"), (251, 0, "global"), (251, 1, "global"), (300, 15, "global"), (300, 16, "hierarchical")],
)
def test_a_few_photographs_without_focal_length_do_not_decide(photos: int, unknown: int, mapper: str) -> None:
    chosen, reason = choose_mapper("auto", photos, 1 - unknown / photos)
    assert chosen == mapper and str(photos) in reason
