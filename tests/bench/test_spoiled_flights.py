"""What is spoiled is spoiled as said, and what is told of it is counted."""

from pathlib import Path

import pandas as pd
import pytest

from aug3d_core.bench.spoiled_flights import COPIES, copy_name, mix, original_name, told_of


def test_broken_files_lose_their_second_half_and_copies_are_whole(tmp_path: Path) -> None:
    files = {}
    for name in ("day0_a.jpg", "day0_b.jpg", "day1_a.jpg"):
        files[name] = tmp_path / f"from_{name}"
        files[name].write_bytes(name.encode() * 10)
    mix(files, ["day0_a.jpg"], ["day1_a.jpg"], tmp_path / "mixed")
    mixed = {file.name: file.read_bytes() for file in (tmp_path / "mixed").iterdir()}
    assert len(mixed) == 3 + COPIES
    assert mixed["day0_a.jpg"] == files["day0_a.jpg"].read_bytes()[:50]
    assert mixed["day0_b.jpg"] == files["day0_b.jpg"].read_bytes()
    for number in range(COPIES):
        assert mixed[copy_name("day1_a.jpg", number)] == files["day1_a.jpg"].read_bytes()


@pytest.mark.parametrize("number", range(COPIES))
def test_a_copy_knows_its_original(number: int) -> None:
    assert original_name(copy_name("day0_town_0007.jpg", number)) == "day0_town_0007.jpg"
    assert original_name("day0_town_0007.jpg") == "day0_town_0007.jpg"


def rejected(*rows: tuple[str, str]) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=["name", "reason"], dtype="str")


def test_what_is_named_counts_by_its_reason() -> None:
    table = rejected(("a.jpg", "cannot be decoded"), ("b_copy1.jpg", "duplicate: same bytes as b.jpg"))
    found = told_of(table, ["a.jpg", "c.jpg"], ["b_copy1.jpg", "b_copy2.jpg"])
    assert (found["broken_named_share"].value, found["broken_named_share"].holds) == (0.5, False)
    assert (found["copies_named_share"].value, found["others_named"].value) == (0.5, 0)


def test_a_good_photograph_that_is_refused_is_counted() -> None:
    found = told_of(rejected(("a.jpg", "too small"), ("b.jpg", "too small")), ["a.jpg"], ["c_copy1.jpg"])
    assert (found["others_named"].value, found["others_named"].holds) == (1, False)


def test_nothing_told_is_no_error() -> None:
    found = told_of(rejected(), ["a.jpg"], ["b_copy1.jpg"])
    assert found["broken_named_share"].value == found["copies_named_share"].value == 0
