"""The grouping stage: similarity -> train/test split and groups of K."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Int

from aug3d_core.geometry.footprint import footprints
from aug3d_core.geometry.shared_points import visibility
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Tracks
from aug3d_core.groups.audit import (
    apart_shares,
    group_doubts,
    jaccard_mean,
    shared_within,
    split_doubts,
    split_figures,
    split_remarks,
)
from aug3d_core.groups.cluster_size import cluster_size
from aug3d_core.groups.config import ENOUGH, GroupingConfig
from aug3d_core.groups.decisions import decisions
from aug3d_core.groups.files import GROUPING_MAP, GROUPS, LEFT_OUT_TABLE
from aug3d_core.groups.left_out import left_out, left_out_table, remarks
from aug3d_core.groups.methods import METHODS, shared_points
from aug3d_core.groups.picture import draw_grouping
from aug3d_core.groups.read_scene import read_scene
from aug3d_core.groups.scene import GroupingScene
from aug3d_core.groups.spare import spare_views
from aug3d_core.run.errors import InputError
from aug3d_core.run.files import EARLIER
from aug3d_core.run.stage import AS_SET, Inputs, Outcome, Progress
from aug3d_core.sfm.files import COMPONENTS, TRACKS
from aug3d_core.split.earlier import earlier_test
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.split.split import Role, Split, split_views


def run(inputs: Inputs, config: GroupingConfig, out: Path, progress: Progress) -> Outcome:
    """Split the views, group those for training, and give each target the support views it shares most with."""
    scene = read_scene(inputs)
    tracks = Tracks.load(inputs["sfm"] / TRACKS)
    views, points_in_world = scene.views, scene.points_in_world
    visible = visibility(tracks, len(views), len(points_in_world))
    footprint = footprints(tracks, points_in_world, scene.look_in_world)
    there: list[str] = json.loads((inputs["sfm"] / COMPONENTS).read_text())["photo_sha256"]
    photo_sha256 = [there[photo_id] for photo_id in views.photo_id]
    earlier = earlier_test(
        inputs.get(EARLIER), photo_sha256, set(there), scene.look_in_world, footprint, config.gap_footprints
    )
    whole = split_views(scene.look_in_world, footprint, views.photo_id, visible, config, earlier)
    thinned = _thinned(whole, scene, config.enough or ENOUGH)
    split = thinned if config.enough else whole
    train = split.views(Role.TRAIN)
    size = _size(scene, train, config)
    rng = np.random.default_rng(config.seed)
    members = METHODS[config.method](scene, train, size.k, config.groups, config, rng)
    alone = left_out(scene, train, members, config.method)
    test_members = test_groups(scene, split, size.k)
    split_table(split, scene, photo_sha256).to_parquet(out / SPLIT_TABLE)
    left_out_table(alone, views.photo_id).to_parquet(out / LEFT_OUT_TABLE)
    with (out / GROUPS).open("wb") as file:
        np.savez(file, members=members, test_members=test_members)
    at, picture = centres(views.cam_from_world)[:, :2], out / GROUPING_MAP
    draw_grouping(at, scene.look_in_world, split, members, config.method, picture)
    progress(1, 1, "views grouped")
    figures = split_figures(split, scene.look_in_world, footprint, visible)
    made = _metrics(scene, train, members, test_members)
    doubts = [*split_doubts(figures, config), *group_doubts(made)]
    chosen = {"method": config.method, "k": size.k, "k_reason": size.reason, "left_out": len(alone)}
    possible = {
        "spare_possible": len(thinned.views(Role.SPARE)),
        "worth_training_on": len(thinned.views(Role.TRAIN)),
        "test_kept": len(split.views(Role.TARGET)) if split.kept else 0,
        "test_reason": split.reason,
    }
    metrics = chosen | made | figures | possible
    notes = (*split_remarks(figures, config), *doubts, *size.notes, *remarks(alone, views.photo_id))
    return Outcome(
        metrics=metrics,
        state="degraded" if size.doubtful or doubts else "ok",
        notes=notes,
        pictures={"Roles and groups": GROUPING_MAP},
        decisions=tuple(decisions(metrics, config, notes)),
    )


def _thinned(split: Split, scene: GroupingScene, enough: int) -> Split:
    """Return the split without photographs that show nothing of their own: training sees none of the others."""
    train, none = split.views(Role.TRAIN), np.empty(0, int)
    split = split.without(spare_views(scene.seen, train, none, enough))
    stay = split.views(Role.TRAIN, Role.SUPPORT)
    return split.without(spare_views(scene.seen, split.views(Role.GAP), stay, enough))


def test_groups(scene: GroupingScene, split: Split, k: int) -> Int[np.ndarray, "t k_test"]:
    """Return for each target the support views that share most points with it, the target first; no other target."""
    support = split.views(Role.SUPPORT)
    size = min(k, len(support) + 1)
    targets = split.views(Role.TARGET).tolist()
    return np.stack([shared_points.most_shared(scene, target, support, size) for target in targets])


def split_table(split: Split, scene: GroupingScene, photo_sha256: list[str]) -> pd.DataFrame:
    """Return one row per view. Nothing in it depends on the groups: stages that read the split alone need not know them."""
    return pd.DataFrame(
        {
            "view": np.arange(len(scene.views)),
            "photo_id": scene.views.photo_id,
            "photo_sha256": photo_sha256,
            "role": split.role.tolist(),
            "folds": split.folds,
            "test_kept": split.kept,
            "look_x": scene.look_in_world[:, 0],
            "look_y": scene.look_in_world[:, 1],
        }
    )


@dataclass(frozen=True)
class _Size:
    """The size of the groups, and why."""

    k: int
    reason: str
    notes: tuple[str, ...] = ()
    doubtful: bool = False


def _size(scene: GroupingScene, train: Int[np.ndarray, " m"], config: GroupingConfig) -> _Size:
    if len(train) < 2:
        raise InputError(
            f"{len(train)} view is left for training",
            "Add photographs, lower grouping.test_share, or raise grouping.enough if it is set.",
        )
    if config.k == "auto":
        k, reason = cluster_size(scene.shared_share, train)
        return _Size(k, reason, (f"K is {k}: {reason}",))
    if config.k > len(train):
        reason = f"there are only {len(train)} training views"
        note = f"K is {len(train)}, not {config.k}: {reason}"
        return _Size(len(train), reason, (note,), doubtful=2 * len(train) < config.k)
    return _Size(config.k, AS_SET)


def _metrics(
    scene: GroupingScene,
    train: Int[np.ndarray, " m"],
    members: Int[np.ndarray, "c k"],
    test_members: Int[np.ndarray, "t k_test"],
) -> dict[str, Any]:
    within = shared_within(scene.shared, members)
    in_test = shared_within(scene.shared, test_members)
    return {
        "groups": len(members),
        "shared_points_mean": float(within.mean()),
        "shared_points_min": int(within.min()),
        "shared_points_p10": float(np.percentile(within, 10)),
        "shared_points_median": float(np.median(within)),
        "members_sharing_nothing_share": float((within == 0).mean()),
        **apart_shares(scene, members),
        "coverage": len(np.unique(members)) / len(train),
        "jaccard_mean": jaccard_mean(members),
        "test_shared_points_median": float(np.median(in_test)),
    }
