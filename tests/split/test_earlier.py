"""An earlier test is found where it is all there, and stays where it still tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from aug3d_core.geometry.footprint import footprints, footprints_apart
from aug3d_core.geometry.shared_points import visibility
from aug3d_core.groups.audit import split_figures
from aug3d_core.groups.config import GroupingConfig
from aug3d_core.split.earlier import earlier_test
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.split.split import MOST_NARROWED, HeldOut, Role, split_views
from tests.groups.strip_scene import fly, scene_of

ROLES = {"a": "target", "b": "support", "c": "support", "d": "gap", "e": "train", "f": "train"}
LOOK = {name: np.array([float(x), 0.0]) for x, name in enumerate("abcdef")}


def write(folder: Path, number: int, roles: dict[str, str], folds: int = 1, **columns: bool) -> None:
    files = folder / f"{number:02d}"
    files.mkdir(parents=True)
    table = {"photo_sha256": [*roles], "role": [*roles.values()], "folds": folds, **columns}
    pd.DataFrame(table).to_parquet(files / SPLIT_TABLE)


def found(
    folder: Path | None, names: str, there: str = "", look: dict[str, np.ndarray] | None = None
) -> HeldOut | None:
    look_in_world = np.stack([(look or LOOK).get(name, np.array([50.0, 0.0])) for name in names])
    return earlier_test(folder, list(names), set(names) | set(there), look_in_world, np.full(len(names), 2.0), 1.5)


def test_a_new_view_is_of_the_block_if_it_looks_nearest_to_one_of_it(tmp_path: Path) -> None:
    write(tmp_path, 0, ROLES)
    look = LOOK | {"x": np.array([1.4, 2.0]), "y": np.array([2.6, 0.0]), "z": LOOK["a"]}
    held = found(tmp_path, "fxzbyadce", look=look)
    assert held is not None
    assert [name for name, of_it in zip("fxzbyadce", held.block, strict=True) if of_it] == [*"xzbac"]
    assert ["fxzbyadce"[view] for view in held.targets] == ["a"]


def test_a_new_view_beyond_the_gap_is_not_of_the_block(tmp_path: Path) -> None:
    write(tmp_path, 0, ROLES)
    held = found(tmp_path, "abcdefxy", look=LOOK | {"x": np.array([-2.9, 0.0]), "y": np.array([-3.0, 0.0])})
    assert held is not None and held.block.tolist() == [True] * 3 + [False] * 3 + [True, False]


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


def test_a_test_that_was_kept_is_one_of_the_same_photographs_too(tmp_path: Path) -> None:
    write(tmp_path, 0, ROLES, test_kept=True)
    held = found(tmp_path, "fedcba")
    assert held is not None and held.block.tolist() == [False] * 3 + [True] * 3 and held.targets.tolist() == [5]
    assert found(tmp_path, "abcde", there="f") is not None, "of two runs of them, the later may place fewer"
    assert found(tmp_path, "abcde") is None, "one was taken out"


def test_a_test_that_was_chosen_is_chosen_again_by_the_same_photographs(tmp_path: Path) -> None:
    write(tmp_path, 0, ROLES, test_kept=False)
    assert found(tmp_path, "abcdef") is None


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


@pytest.mark.parametrize(
    ("block", "test_share", "stays"), [(3, 0.3, True), (3, 0.31, False), (12, 0.3, True), (12, 0.29, False)]
)
def test_an_earlier_test_stays_while_it_is_half_to_twice_the_share_asked_for(
    block: int, test_share: float, stays: bool
) -> None:
    told = f"the test block of before holds {block / 20:.0%} of the photographs, and its gap is narrowed by 0%"
    assert split_of(block, test_share) == (stays, told)


def test_an_earlier_test_that_training_sees_does_not_stay() -> None:
    assert split_of(5, 0.3, overlapping=15.0)[0]
    kept, reason = split_of(5, 0.3, overlapping=40.0)
    assert not kept and "its gap is narrowed by 78%" in reason


@pytest.mark.parametrize(
    ("new", "support", "gap", "train"),
    [(np.arange(36, 60), 4, 4, 16), (np.arange(-24, 0), 0, 0, 24)],
    ids=["beyond the test", "beyond training"],
)
def test_photographs_of_new_ground_are_trained_on(
    tmp_path: Path, new: np.ndarray, support: int, gap: int, train: int
) -> None:
    names, x, config = [f"photo{view}" for view in range(60)], np.append(np.arange(36), new), GroupingConfig(folds=1)
    look, footprint = np.stack([x, np.zeros(60)], 1), np.full(60, 5.0)
    sees = sparse.csr_array((np.abs(x[:, None] - np.arange(-30, 70)) < 3).astype(np.int32))
    first = split_views(look[:36], footprint[:36], np.arange(36), sees[:36], config)
    write(tmp_path, 0, dict(zip(names[:36], first.role.tolist(), strict=True)))
    earlier = earlier_test(tmp_path, names, set(names), look, footprint, config.gap_footprints)
    split = split_views(look, footprint, np.arange(60), sees, config, earlier)
    added = [int((split.role[36:] == role).sum()) for role in (Role.SUPPORT, Role.GAP, Role.TRAIN)]
    assert split.kept and added == [support, gap, train]


@settings(max_examples=20)
@given(st.integers(0, 2**31), st.integers(36, 59), st.sampled_from(["west", "east", "all over"]))
def test_training_keeps_the_gap_around_a_test_that_stays(
    tmp_path_factory: pytest.TempPathFactory, seed: int, known: int, new: str
) -> None:
    flight, config, folder = fly(60, 600, 800.0, seed), GroupingConfig(folds=1), tmp_path_factory.mktemp("earlier")
    look, sees = scene_of(*flight).look_in_world, visibility(flight[2], 60, 600)
    footprint, names = footprints(flight[2], flight[1].xyz, look), [str(view) for view in range(60)]
    eastwards = np.argsort(look[:, 0])
    order = {"east": eastwards, "west": eastwards[::-1], "all over": np.random.default_rng(seed).permutation(60)}[new]
    was, added = np.sort(order[:known]), order[known:]
    first = split_views(look[was], footprint[was], was, sees[was], config)
    write(folder, 0, dict(zip([names[view] for view in was], first.role.tolist(), strict=True)))
    earlier = earlier_test(folder, names, set(names), look, footprint, config.gap_footprints)
    split = split_views(look, footprint, np.arange(60), sees, config, earlier)
    assert split.kept and split.views(Role.TARGET).tolist() == was[first.views(Role.TARGET)].tolist()
    narrowed = int(split.reason.split()[-1].rstrip("%")) / 100 + 0.005  # it is told in whole per cents
    figures = split_figures(split, look, footprint, sees)
    assert narrowed <= MOST_NARROWED and figures["gap_footprints"] >= config.gap_footprints * (1 - narrowed)
    assert figures["gap_shared_share"] <= config.gap_shared_share + narrowed * (1 - config.gap_shared_share)
    block = was[first.views(Role.SUPPORT, Role.TARGET)]
    far = added[footprints_apart(look, footprint, added, block).min(axis=1) >= config.gap_footprints]
    assert not np.isin(split.role[far], [Role.SUPPORT, Role.TARGET]).any()
