"""An earlier test is found where it is all there, and stays where it still tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import sparse

from aug3d_core.groups.config import GroupingConfig
from aug3d_core.split.earlier import earlier_test
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.split.split import HeldOut, Role, split_views

ROLES = {"a": "target", "b": "support", "c": "support", "d": "gap", "e": "train", "f": "train"}
LOOK = {name: np.array([float(x), 0.0]) for x, name in enumerate("abcdef")}


def write(folder: Path, number: int, roles: dict[str, str], folds: int = 1) -> None:
    files = folder / f"{number:02d}"
    files.mkdir(parents=True)
    table = {"photo_sha256": [*roles], "role": [*roles.values()], "folds": folds}
    pd.DataFrame(table).to_parquet(files / SPLIT_TABLE)


def found(
    folder: Path | None, names: str, there: str = "", look: dict[str, np.ndarray] | None = None
) -> HeldOut | None:
    look_in_world = np.stack([(look or LOOK).get(name, np.array([50.0, 0.0])) for name in names])
    return earlier_test(folder, list(names), set(names) | set(there), look_in_world)


def test_a_new_view_is_of_the_block_if_it_looks_nearest_to_one_of_it(tmp_path: Path) -> None:
    write(tmp_path, 0, ROLES)
    look = LOOK | {"x": np.array([1.4, 9.0]), "y": np.array([2.6, 0.0]), "z": LOOK["a"]}
    held = found(tmp_path, "fxzbyadce", look=look)
    assert held is not None
    assert [name for name, of_it in zip("fxzbyadce", held.block, strict=True) if of_it] == [*"xzbac"]
    assert ["fxzbyadce"[view] for view in held.targets] == ["a"]


def test_two_views_of_one_place_keep_their_parts(tmp_path: Path) -> None:
    write(tmp_path, 0, ROLES)
    held = found(tmp_path, "abcdefx", look=LOOK | {"d": LOOK["c"]})
    assert held is not None and held.block.tolist() == [True, True, True, False, False, False, False]


@pytest.mark.parametrize(
    ("today", "there"),
    [
        ("abcdef", ""),  # nothing is new
        ("acdefxyz", "b"),  # a photograph of the test has no pose
        ("abcdexyz", ""),  # one of training is not there any more: the scene has not grown
        ("abcdefghijklm", ""),  # more is new than known
    ],
)
def test_a_split_of_no_true_part_of_today_is_none(tmp_path: Path, today: str, there: str) -> None:
    write(tmp_path, 0, ROLES)
    assert found(tmp_path, today, there) is None


def test_a_photograph_of_training_may_be_without_a_pose(tmp_path: Path) -> None:
    write(tmp_path, 0, ROLES)
    assert found(tmp_path, "abcdexyz", there="f") is not None


def test_one_of_folds_is_none_and_so_is_no_folder(tmp_path: Path) -> None:
    write(tmp_path, 0, ROLES, folds=2)
    assert found(tmp_path, "abcdefx") is None
    assert found(tmp_path / "none", "abcdefx") is None
    assert found(None, "abcdefx") is None


def test_the_largest_counts_and_the_newest_of_equals(tmp_path: Path) -> None:
    smaller = {name: role for name, role in ROLES.items() if name != "f"}
    write(tmp_path, 0, smaller | {"a": "support", "b": "target"})
    write(tmp_path, 1, ROLES)
    write(tmp_path, 2, ROLES | {"a": "support", "c": "target"})
    held = found(tmp_path, "abcdefx")
    assert held is not None and held.targets.tolist() == [0]


def split_of(block: int, test_share: float, overlapping: float = 0.0) -> tuple[bool, str]:
    """Return whether a test block of the first views of 20 in a row stays, and what was found."""
    look = np.array([[x, 0.0] for x in range(20)])
    sees = sparse.csr_array(np.eye(20, dtype=np.int32))
    earlier = HeldOut(np.arange(20) < block, np.arange(1, block, 3))
    config = GroupingConfig(folds=1, test_share=test_share)
    split = split_views(look, np.full(20, 0.5 + overlapping), np.arange(20), sees, config, earlier)
    if split.kept:
        assert np.flatnonzero(split.role == Role.TARGET).tolist() == earlier.targets.tolist()
    return split.kept, split.reason


def test_an_earlier_test_stays_while_it_is_half_the_share_asked_for() -> None:
    assert split_of(3, 0.3) == (True, "the test block holds 15% of the photographs, and its gap is narrowed by 0%")
    assert split_of(3, 0.4) == (False, "the test block holds 15% of the photographs, and its gap is narrowed by 0%")


def test_an_earlier_test_that_training_sees_does_not_stay() -> None:
    assert split_of(5, 0.3, overlapping=15.0)[0]
    kept, reason = split_of(5, 0.3, overlapping=40.0)
    assert not kept and "its gap is narrowed by 78%" in reason
