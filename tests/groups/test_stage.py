"""Both stages on files: what is written holds together, repeats, and degrades with a note."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError
from scipy import sparse

from aug3d_core.geometry.views import Tracks
from aug3d_core.groups import similarity_stage, stage
from aug3d_core.groups.config import ENOUGH, GroupingConfig, SimilarityConfig
from aug3d_core.groups.methods import METHODS
from aug3d_core.run.errors import InputError
from aug3d_core.run.stage import Outcome
from tests.groups.strip_scene import fly, part_of, write_sfm
from tests.same_files import assert_same_files


def silent(done: int, total: int, what: str) -> None: ...


def run_both(
    tmp_path: Path,
    flight: tuple,
    out: str = "out",
    photo_sha256: Sequence[str] | None = None,
    earlier: Path | None = None,
    **config: float | str,
) -> tuple[Outcome, Outcome, Path]:
    sfm = write_sfm(tmp_path / out / "sfm", flight, photo_sha256)
    similarity, grouping = tmp_path / out / "similarity", tmp_path / out / "grouping"
    similarity.mkdir()
    grouping.mkdir()
    alike = similarity_stage.run({"sfm": sfm}, SimilarityConfig(), similarity, silent)
    inputs = {"sfm": sfm, "similarity": similarity} | ({"earlier": earlier} if earlier else {})
    grouped = stage.run(inputs, GroupingConfig(**config), grouping, silent)
    return alike, grouped, grouping


def test_groups_and_split_hold_together(tmp_path: Path) -> None:
    _, outcome, out = run_both(tmp_path, fly(), k=6)
    split = pd.read_parquet(out / "split.parquet").set_index("view")
    with np.load(out / "groups.npz") as arrays:
        members, test_members = arrays["members"], arrays["test_members"]
    assert outcome.state == "ok"
    assert members.shape == (outcome.metrics["groups"], 6)
    assert set(split["role"][members.ravel()]) == {"train"}
    assert set(split["role"][test_members[:, 0]]) == {"target"}
    assert set(split["role"][test_members[:, 1:].ravel()]) == {"support"}
    assert sorted(test_members[:, 0]) == split.index[split["role"] == "target"].tolist()
    assert (split["photo_id"] == np.arange(40) * 3).all()
    assert np.isfinite(split[["look_x", "look_y"]]).all(axis=None)
    counts = [outcome.metrics[f"{role}_views"] for role in ("train", "gap", "support", "target")]
    assert sum(counts) == 40
    assert outcome.metrics["folds"] == 1 and outcome.metrics["gap_footprints"] >= 1
    assert outcome.metrics["gap_shared_share"] <= 0.1 and outcome.metrics["leak_shared_share_max"] <= 0.1
    assert (out / outcome.pictures["Roles and groups"]).exists()


def test_the_similarity_file_is_symmetric_int32(tmp_path: Path) -> None:
    outcome, _, out = run_both(tmp_path, fly())
    shared = sparse.load_npz(out.parent / "similarity" / "shared_points.npz")
    assert shared.dtype == np.int32
    assert abs(shared - shared.T).nnz == 0
    assert outcome.metrics["connected_share"] == 1.0


def test_same_input_same_bytes(tmp_path: Path) -> None:
    run_both(tmp_path, fly(), "one")
    run_both(tmp_path, fly(), "two")
    assert_same_files(tmp_path / "one", tmp_path / "two")


def roles(out: Path) -> pd.Series:
    table = pd.read_parquet(out / "split.parquet")
    return table["role"].astype(str).set_axis(table["photo_sha256"])


@pytest.mark.parametrize("new", [np.arange(5, 60, 10), np.arange(24, 36)], ids=["spread", "at the end"])
def test_a_scene_that_grows_is_tested_on_the_photographs_of_before(tmp_path: Path, new: np.ndarray) -> None:
    flight, was = fly(60, points=6000), np.setdiff1d(np.arange(60), new)[::-1]
    folder = tmp_path / "earlier"
    folder.mkdir()
    (folder / "00").symlink_to(run_both(tmp_path, part_of(flight, was), "was", [f"photo{i}" for i in was])[2])
    now, named = part_of(flight, np.arange(60)), [f"photo{i}" for i in range(60)]
    _, grown, out = run_both(tmp_path, now, "grown", named, folder)
    _, anew, fresh = run_both(tmp_path, now, "anew", named)
    before, after, otherwise = roles(folder / "00"), roles(out), roles(fresh)
    targets = before.index[before == "target"]
    assert set(after.index[after == "target"]) == set(targets) != set(otherwise.index[otherwise == "target"])
    assert (after[before.index[before == "support"]] == "support").all(), "what was given stays given"
    added = after[[f"photo{i}" for i in new]]
    assert (added != "target").all() and (added == "support").any() == (otherwise[added.index] == "support").any()
    assert grown.metrics["gap_shared_share"] <= 0.1 and grown.metrics["gap_footprints"] >= 1, (
        "training sees no more of it"
    )
    assert grown.metrics["test_kept"] == len(targets) and not anew.metrics["test_kept"]
    told = next(decision for decision in grown.decisions if decision.field == "grouping.test")
    assert (
        told.value == f"the {len(targets)} photographs of before" and "of the photographs, and its gap" in told.measured
    )
    assert all(decision.field != "grouping.test" for decision in anew.decisions)


def test_a_test_that_was_kept_stays_where_the_same_photographs_get_other_poses(tmp_path: Path) -> None:
    flight, tested, before = fly(60, points=1500), [], None
    for run, (missing, scale) in enumerate([(range(5, 60, 10), 1.0), ([], 1.0), ([], 1.1)]):
        there = np.setdiff1d(np.arange(60), missing)
        views, points, tracks = part_of(flight, there)
        moved = replace(points, xyz=scale * points.xyz)
        named, folder = [f"photo{i}" for i in there], tmp_path / f"earlier{run}"
        folder.mkdir()
        if before:
            (folder / "00").symlink_to(before)
        _, outcome, before = run_both(tmp_path, (views, moved, tracks), f"run{run}", named, folder, k=4)
        assert bool(outcome.metrics["test_kept"]) == (run > 0)
        role = roles(before)
        tested.append(set(role.index[role == "target"]))
    assert all(targets == tested[0] for targets in tested)


def test_spare_photographs_are_left_out_and_counted_where_none_is(tmp_path: Path) -> None:
    _, whole, out = run_both(tmp_path, fly(80), "whole", k=6)
    _, thinned, thin = run_both(tmp_path, fly(80), "thin", k=6, enough=ENOUGH)
    before, after = (pd.read_parquet(folder / "split.parquet")["role"].astype(str) for folder in (out, thin))
    spare = after == "spare"
    assert before[spare].isin(["train", "gap"]).all() and (before[~spare] == after[~spare]).all(), (
        "the test stays as it is"
    )
    assert 0.2 < spare.sum() / before.isin(["train", "gap"]).sum() < 0.8, "each place is in up to sixteen photographs"
    with np.load(thin / "groups.npz") as arrays:
        assert set(after[arrays["members"].ravel()]) == {"train"}
    assert thinned.metrics["spare_views"] == whole.metrics["spare_possible"] == spare.sum()
    assert whole.metrics["spare_views"] == 0 and (before[spare] == "gap").any() and (after == "gap").any()
    for one in (thinned, whole):
        assert one.metrics["worth_training_on"] == thinned.metrics["train_views"] < whole.metrics["train_views"]
    told, only_counted = (next(d for d in one.decisions if d.field == "grouping.enough") for one in (thinned, whole))
    used = before.isin(["train", "gap"]).sum()
    assert told.value == only_counted.value == f"{used - spare.sum()} of {used}" and told.saves
    assert not only_counted.saves and "all are used" in only_counted.rule


def test_k_larger_than_the_training_views_is_reduced_with_a_note(tmp_path: Path) -> None:
    _, outcome, _ = run_both(tmp_path, fly(12), k=10)
    train = outcome.metrics["train_views"]
    assert outcome.metrics["k"] == train < 10
    assert f"K is {train}, not 10: there are only {train} training views" in outcome.notes


def test_k_reduced_below_half_is_degraded(tmp_path: Path) -> None:
    assert run_both(tmp_path, fly(20), k=30)[1].state == "degraded"


def test_views_in_no_group_are_listed(tmp_path: Path) -> None:
    _, outcome, out = run_both(tmp_path, fly(), k=3, groups=2)
    with np.load(out / "groups.npz") as arrays:
        grouped = len(np.unique(arrays["members"]))
    alone = outcome.metrics["train_views"] - grouped
    assert f"{alone} training views are in no group (every group found better members): photos" in outcome.notes[0]
    split, lonely = (pd.read_parquet(out / name) for name in ("split.parquet", "left_out.parquet"))
    assert len(lonely) == outcome.metrics["left_out"] == alone
    assert set(split["role"][lonely["view"]]) == {"train"}
    assert (split["photo_id"][lonely["view"]].to_numpy() == lonely["photo_id"].to_numpy()).all()


def test_the_split_is_the_same_to_the_byte_whatever_the_groups(tmp_path: Path) -> None:
    splits = [
        (run_both(tmp_path / f"{method}{k}", fly(), k=k, method=method)[2] / "split.parquet").read_bytes()
        for method, k in (("shared", 3), ("shared", 8), ("sequence", 8))
    ]
    assert len(set(splits)) == 1


@pytest.mark.parametrize("method", METHODS)
def test_every_method_runs_and_says_so(tmp_path: Path, method: str) -> None:
    _, outcome, _ = run_both(tmp_path, fly(), k=4, method=method)
    assert outcome.metrics["method"] == method
    assert outcome.metrics["coverage"] == 1 - outcome.metrics["left_out"] / outcome.metrics["train_views"]
    assert 0 <= outcome.metrics["jaccard_mean"] < 1


def test_members_that_do_not_belong_together_are_told(tmp_path: Path) -> None:
    _, outcome, _ = run_both(tmp_path, fly(40, length_m=4000.0), k=8)
    apart = outcome.metrics["members_apart_share"]
    assert apart > 0.2
    assert outcome.state == "degraded"
    assert f"{apart:.0%} of the members share next to nothing with their group's centre" in outcome.notes[-1]


def test_k_by_itself_is_told_with_its_reason(tmp_path: Path) -> None:
    _, outcome, _ = run_both(tmp_path, fly(), k="auto")
    assert 2 < outcome.metrics["k"] <= 20
    assert outcome.notes[-1] == f"K is {outcome.metrics['k']}: {outcome.metrics['k_reason']}"


@pytest.mark.parametrize("k", [1, 0, -3, "many"])
def test_groups_of_fewer_than_two_are_refused(k: int) -> None:
    with pytest.raises(ValidationError):
        GroupingConfig(k=k)


def test_a_lonely_view_is_left_out_with_the_reason(tmp_path: Path) -> None:
    views, points, tracks = fly(40)
    keep = tracks.view != 2
    flight = views, points, Tracks(tracks.point[keep], tracks.view[keep], tracks.xy[keep])
    _, outcome, _ = run_both(tmp_path, flight, k=4)
    assert "1 training views are in no group (it overlaps with too few others): photos 6" in outcome.notes


def test_a_pose_that_is_not_finite_names_the_photo(tmp_path: Path) -> None:
    views, points, tracks = fly(20)
    views.cam_from_world[5] = np.nan
    with pytest.raises(InputError, match="pose of photo 15"):
        run_both(tmp_path, (views, points, tracks))


def test_no_room_for_a_gap_is_degraded(tmp_path: Path) -> None:
    _, outcome, _ = run_both(tmp_path, fly(length_m=1.0), k=4)
    assert outcome.state == "degraded"
    assert "footprints wide, and training shares up to" in outcome.notes[0]
    assert "points with the test block: the test says little" in outcome.notes[1]


def test_a_small_scene_says_that_it_has_folds_and_which_this_is(tmp_path: Path) -> None:
    _, outcome, _ = run_both(tmp_path, fly(18), k=4, fold=1)
    assert outcome.metrics["folds"] == 2
    assert "made in 2 folds" in outcome.notes[0] and "block 1 (from 0) in this one" in outcome.notes[0]


def test_a_test_of_one_photograph_is_degraded(tmp_path: Path) -> None:
    _, outcome, _ = run_both(tmp_path, fly(8), k=4)
    assert outcome.state == "degraded"
    assert any("only 1 of the photographs test the model" in note for note in outcome.notes)


def test_two_parts_that_share_nothing_are_noted(tmp_path: Path) -> None:
    views, points, tracks = fly(40, length_m=2000.0)
    alike, _, _ = run_both(tmp_path, (views, points, tracks), k=2)
    assert alike.metrics["connected_share"] < 1
    assert "views share fewer than 20 points" in alike.notes[0]


def test_a_blind_view_does_not_stop_the_stage(tmp_path: Path) -> None:
    views, points, tracks = fly(20)
    keep = tracks.view != 4
    _, _, out = run_both(tmp_path, (views, points, Tracks(tracks.point[keep], tracks.view[keep], tracks.xy[keep])), k=3)
    assert np.isfinite(pd.read_parquet(out / "split.parquet")["look_x"]).all()


def test_three_views_are_refused(tmp_path: Path) -> None:
    views, points, tracks = fly(4)
    keep = tracks.view < 3
    flight = views.take(np.arange(3)), points, Tracks(tracks.point[keep], tracks.view[keep], tracks.xy[keep])
    with pytest.raises(InputError, match="3 views are too few"):
        run_both(tmp_path, flight)
