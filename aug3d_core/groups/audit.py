"""Figures that say how good groups and split are, and what to think of them."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float, Int, Shaped
from scipy import sparse

from aug3d_core.geometry.footprint import footprints_apart
from aug3d_core.groups.config import GroupingConfig
from aug3d_core.groups.methods.shared_points import OVERLAPS
from aug3d_core.groups.scene import GroupingScene
from aug3d_core.split.split import LEAST_TARGETS, Role, Split, shared_share_with

_NO_GAP = 0.5  # training that shares more than this of its points with the test block makes the test say little
# Every second draw of three input views then holds one that shows next to nothing of the group's centre: 1 - 0.8^3 = 0.49
MANY_APART = 0.2


def shared_within(shared: sparse.csr_array, members: Int[np.ndarray, "c k"]) -> Shaped[np.ndarray, "c k-1"]:
    """Return the points, or the share of them, that each member shares with its group's centre."""
    centres = np.repeat(members[:, 0], members.shape[1] - 1)
    return np.asarray(shared[centres, members[:, 1:].ravel()]).reshape(len(members), -1)


def jaccard_mean(members: Int[np.ndarray, "c k"]) -> float | None:
    """Return the mean over all pairs of groups of the views in both over the views in either; None for one group."""
    count, k = members.shape
    if count < 2:
        return None
    group = np.repeat(np.arange(count), k)
    belongs = sparse.csr_array((np.ones(members.size, np.int32), (group, members.ravel())))
    common = (belongs @ belongs.T).data
    return float(((common / (2 * k - common)).sum() - count) / (count * (count - 1)))


def leak_shared_share(visible: sparse.csr_array, split: Split) -> Float[np.ndarray, " m"]:
    """Return, for each training view, the largest share of its points that any single target sees too."""
    train, targets = split.views(Role.TRAIN), split.views(Role.TARGET)
    common = (visible[train] @ visible[targets].T).toarray()
    return common.max(axis=1) / np.maximum(visible[train].sum(axis=1), 1)


def split_figures(
    split: Split,
    look_in_world: Float[np.ndarray, "n 2"],
    footprint: Float[np.ndarray, " n"],
    visible: sparse.csr_array,
) -> dict[str, Any]:
    """Return how many views have each role, and the gap that there is, whatever was asked for."""
    train, block = split.views(Role.TRAIN), split.views(Role.SUPPORT, Role.TARGET)
    leak = leak_shared_share(visible, split)
    return {
        "folds": split.folds,
        **{f"{role}_views": len(split.views(role)) for role in Role},
        "footprint_world_units": round(float(np.median(footprint)), 4),
        "gap_footprints": round(float(footprints_apart(look_in_world, footprint, train, block).min()), 4),
        "gap_shared_share": float(shared_share_with(visible, np.isin(np.arange(len(split.role)), block))[train].max()),
        "leak_shared_share_max": float(leak.max()),
        "leak_shared_share_mean": float(leak.mean()),
    }


def split_remarks(figures: dict[str, Any], config: GroupingConfig) -> list[str]:
    """Say what was done to a scene that is small, and is good to know."""
    remarks = []
    if figures["folds"] > 1:
        remarks.append(
            f"a small scene, made in {figures['folds']} folds: each of {figures['folds']} blocks of ground is held out once,"
            f" block {config.fold} (from 0) in this one"
        )
    if figures["gap_footprints"] < config.gap_footprints or figures["gap_shared_share"] > config.gap_shared_share:
        remarks.append(
            f"the gap around the test block is {figures['gap_footprints']:.2f} footprints wide, and training shares up to"
            f" {figures['gap_shared_share']:.0%} of its points with the block, where {config.gap_footprints:g} and"
            f" {config.gap_shared_share:.0%} were asked for: more would leave too few training views"
        )
    return remarks


def apart_shares(scene: GroupingScene, members: Int[np.ndarray, "c k"]) -> dict[str, Any]:
    """Return the share of members that have next to nothing of what their group's centre sees, counted in two ways.

    By points: from both sides of a tower, the ground beyond gives views many points in common, small in their pictures. By
    surface, as shares of the pictures: where points are few, nothing is seen to be hidden.
    """
    counted = {"members_apart_share": scene.shared_share, "members_unseen_share": scene.seen_share}
    return {name: float((shared_within(share, members) < OVERLAPS).mean()) for name, share in counted.items()}


def group_doubts(figures: dict[str, Any]) -> list[str]:
    """Say so where members do not belong together."""
    apart = max(figures["members_apart_share"], figures["members_unseen_share"])
    if apart <= MANY_APART:
        return []
    return [f"{apart:.0%} of the members share next to nothing with their group's centre: try a smaller K, or k=auto"]


def split_doubts(figures: dict[str, Any], config: GroupingConfig) -> list[str]:
    """Say what makes the test less than it should be."""
    doubts = []
    if figures["gap_shared_share"] > max(_NO_GAP, config.gap_shared_share):
        doubts.append(
            f"training views share up to {figures['gap_shared_share']:.0%} of their points with the test block: the test"
            " says little"
        )
    if figures["folds"] == 1 and figures["target_views"] < LEAST_TARGETS:
        doubts.append(f"only {figures['target_views']} of the photographs test the model: the figures say little")
    return doubts
