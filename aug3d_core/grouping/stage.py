"""The grouping stage: similarity -> train/test split and groups of K."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float, Int
from scipy import sparse

from aug3d_core.errors import InputError
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.grouping import shared_points
from aug3d_core.grouping.audit import leak_shared_share, shared_within
from aug3d_core.grouping.config import GroupingConfig
from aug3d_core.grouping.picture import draw_grouping
from aug3d_core.grouping.scene import GroupingScene
from aug3d_core.grouping.similarity import look_positions, visibility
from aug3d_core.grouping.split import Role, Split, split_views
from aug3d_core.stage import Inputs, Outcome, Progress
from aug3d_core.store import layout

_NO_GAP = 0.5  # training that sees more than this of the test block makes the test say little


def run(inputs: Inputs, config: GroupingConfig, out: Path, progress: Progress) -> Outcome:
    """Split the views, group those for training, and give each target the support views it shares most with."""
    views = Views.load(inputs["sfm"] / layout.VIEWS)
    points = Points.load(inputs["sfm"] / layout.POINTS)
    tracks = Tracks.load(inputs["sfm"] / layout.TRACKS)
    shared = sparse.csr_array(sparse.load_npz(inputs["similarity"] / layout.SHARED_POINTS))
    visible = visibility(tracks, len(views), len(points.xyz))
    scene = GroupingScene(views, shared, _look(tracks, points, views))
    split = split_views(scene.look_in_world, views.photo_id, visible, config.test_share, config.gap_shared_share)
    train = split.views(Role.TRAIN)
    k = min(config.k, len(train))
    if k < 2:
        raise InputError(f"{len(train)} view is left for training", "Add photographs, or lower grouping.test_share.")
    rng = np.random.default_rng(config.seed)
    members = shared_points.group(scene, train, k, config.groups, rng)
    test_members = test_groups(scene, split, k)
    split_table(split, scene).to_parquet(out / layout.SPLIT_TABLE)
    with (out / layout.GROUPS).open("wb") as file:
        np.savez(file, members=members, test_members=test_members)
    draw_grouping(centres(views.cam_from_world)[:, :2], scene.look_in_world, split, members, out / layout.GROUPING_MAP)
    progress(1, 1, "views grouped")
    notes, degraded = _notes(split, members, config, k, views)
    return Outcome(
        metrics=_metrics(scene, split, members, test_members, visible),
        state="degraded" if degraded else "ok",
        notes=tuple(notes),
        pictures={"Roles and groups": layout.GROUPING_MAP},
    )


def test_groups(scene: GroupingScene, split: Split, k: int) -> Int[np.ndarray, "t k_test"]:
    """Return for each target the support views that share most points with it, the target first; no other target."""
    support = split.views(Role.SUPPORT)
    size = min(k, len(support) + 1)
    targets = split.views(Role.TARGET).tolist()
    return np.stack([shared_points.most_shared(scene, target, support, size) for target in targets])


def split_table(split: Split, scene: GroupingScene) -> pd.DataFrame:
    """Return one row per view."""
    return pd.DataFrame(
        {
            "view": np.arange(len(scene.views)),
            "photo_id": scene.views.photo_id,
            "role": split.role.tolist(),
            "look_x": scene.look_in_world[:, 0],
            "look_y": scene.look_in_world[:, 1],
        }
    )


def _look(tracks: Tracks, points: Points, views: Views) -> Float[np.ndarray, "n 2"]:
    # A view that sees no point keeps its place in the files; it looks straight down, for want of better.
    look, seen = look_positions(tracks, points.xyz, len(views))
    return np.where((seen > 0)[:, None], look, centres(views.cam_from_world)[:, :2])


def _metrics(
    scene: GroupingScene,
    split: Split,
    members: Int[np.ndarray, "c k"],
    test_members: Int[np.ndarray, "t k_test"],
    visible: sparse.csr_array,
) -> dict[str, Any]:
    within = shared_within(scene.shared, members)
    in_test = shared_within(scene.shared, test_members)
    leak = leak_shared_share(visible, split)
    return {
        "groups": len(members),
        "k": members.shape[1],
        "shared_points_mean": float(within.mean()),
        "shared_points_min": int(within.min()),
        "shared_points_p10": float(np.percentile(within, 10)),
        "shared_points_median": float(np.median(within)),
        "members_sharing_nothing_share": float((within == 0).mean()),
        "test_shared_points_median": float(np.median(in_test)),
        **{f"{role}_views": len(split.views(role)) for role in Role},
        "gap_shared_share": split.gap_shared_share,
        "leak_shared_share_max": float(leak.max()),
        "leak_shared_share_mean": float(leak.mean()),
    }


def _notes(
    split: Split, members: Int[np.ndarray, "c k"], config: GroupingConfig, k: int, views: Views
) -> tuple[list[str], bool]:
    notes, degraded = [], False
    if k < config.k:
        notes.append(f"K is {k}, not {config.k}: there are only {k} training views")
        degraded = 2 * k < config.k
    if split.gap_shared_share > config.gap_shared_share:
        notes.append(
            f"training views may share up to {split.gap_shared_share:.0%} of their points with the test block, not "
            f"{config.gap_shared_share:.0%}: a wider gap would leave too few of them"
        )
        degraded |= split.gap_shared_share > _NO_GAP
    if len(lonely := np.setdiff1d(split.views(Role.TRAIN), members)):
        photos = ", ".join(str(views.photo_id[view]) for view in lonely[:10]) + (", ..." if len(lonely) > 10 else "")
        notes.append(f"{len(lonely)} training views are in no group: photos {photos}")
    return notes, degraded
