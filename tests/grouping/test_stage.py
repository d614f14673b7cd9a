"""Both stages on files: what is written holds together, repeats, and degrades with a note."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from grouping.strip_scene import fly
from scipy import sparse

from aug3d_core.errors import InputError
from aug3d_core.geometry.views import Tracks
from aug3d_core.grouping import similarity_stage, stage
from aug3d_core.grouping.config import GroupingConfig, SimilarityConfig
from aug3d_core.stage import Outcome


def silent(done: int, total: int, what: str) -> None: ...


def write_sfm(folder: Path, flight: tuple) -> Path:
    folder.mkdir(parents=True)
    for part, name in zip(flight, ("views.npz", "points.npz", "tracks.npz"), strict=True):
        part.save(folder / name)
    return folder


def run_both(tmp_path: Path, flight: tuple, out: str = "out", **config: float) -> tuple[Outcome, Outcome, Path]:
    sfm = write_sfm(tmp_path / out / "sfm", flight)
    similarity, grouping = tmp_path / out / "similarity", tmp_path / out / "grouping"
    similarity.mkdir()
    grouping.mkdir()
    alike = similarity_stage.run({"sfm": sfm}, SimilarityConfig(), similarity, silent)
    grouped = stage.run({"sfm": sfm, "similarity": similarity}, GroupingConfig(**config), grouping, silent)
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
    assert outcome.metrics["leak_shared_share_max"] <= 0.1
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
    for file in sorted(path.relative_to(tmp_path / "one") for path in (tmp_path / "one").rglob("*.*")):
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes(), file


def test_k_larger_than_the_training_views_is_reduced_with_a_note(tmp_path: Path) -> None:
    _, outcome, _ = run_both(tmp_path, fly(12), k=10)
    train = outcome.metrics["train_views"]
    assert outcome.metrics["k"] == train < 10
    assert outcome.state == "ok"
    assert f"K is {train}, not 10" in outcome.notes[0]


def test_k_reduced_below_half_is_degraded(tmp_path: Path) -> None:
    assert run_both(tmp_path, fly(20), k=30)[1].state == "degraded"


def test_views_in_no_group_are_listed(tmp_path: Path) -> None:
    _, outcome, out = run_both(tmp_path, fly(), k=3, groups=2)
    with np.load(out / "groups.npz") as arrays:
        grouped = len(np.unique(arrays["members"]))
    assert f"{outcome.metrics['train_views'] - grouped} training views are in no group" in outcome.notes[0]


def test_no_room_for_a_gap_is_degraded(tmp_path: Path) -> None:
    _, outcome, _ = run_both(tmp_path, fly(length_m=1.0), k=4)
    assert outcome.state == "degraded"
    assert "of their points with the test block, not 10%" in outcome.notes[0]


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
