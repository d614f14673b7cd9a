from __future__ import annotations

from aug3d_core.photos.config import PhotosConfig
from aug3d_core.photos.decisions import decisions


def test_photographs_worth_using_are_reported_if_redundant_ones_were_to_be_left_out() -> None:
    [worth] = decisions({"photos": 60, "redundant": 240}, PhotosConfig(least_motion=0.05))
    assert worth.value == "60 of 300" and worth.saves == "80% of the photographs"
    assert not list(decisions({"photos": 60, "redundant": 0}, PhotosConfig(least_motion=0.0)))
