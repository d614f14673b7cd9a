"""Keep a block of ground for the test, with a gap around it, so that nothing is predicted that training has seen.

The block is one end of the ground that the views look at, cut across its longest direction. Its views are `support`
(inputs at test time) or `target` (what is predicted). Views outside that share too many points with the block are
`gap` and are used by nobody in training; the rest is `train`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import sparse

from aug3d_core.errors import InputError

_EVERY_THIRD = 3
_LEAST_TRAIN_SHARE = 0.35
_RELAXED_BY = 0.1


class Role(StrEnum):
    """What a view is used for."""

    TRAIN = "train"
    GAP = "gap"
    SUPPORT = "support"
    TARGET = "target"


@dataclass(frozen=True)
class Split:
    """The role of each view, and the share of points in common with the test block from which a view is in the gap."""

    role: np.ndarray  # (n,) of str
    gap_shared_share: float

    def views(self, *roles: Role) -> Int[np.ndarray, " m"]:
        """Return the views that have one of the roles."""
        return np.flatnonzero(np.isin(self.role, [str(role) for role in roles]))


def split_views(
    look_in_world: Float[np.ndarray, "n 2"],
    photo_id: Int[np.ndarray, " n"],
    visible: sparse.csr_array,
    test_share: float,
    gap_shared_share: float,
) -> Split:
    """Split the views; `visible` is views x points.

    The end that leaves more views for training is taken. If fewer than about a third (and at least 2) of the views are
    left, the gap is narrowed step by step; `Split.gap_shared_share` says to what.
    """
    count = len(look_in_world)
    if count < 4:
        raise InputError(
            f"{count} views are too few for a test: it needs 2, and training needs 2",
            "Add photographs that overlap with the ones that could be placed.",
        )
    size = min(max(2, round(test_share * count)), count - 2)
    least_train = max(2, round(_LEAST_TRAIN_SHARE * count))
    blocks = [_block(look_in_world, photo_id, size, end) for end in (+1.0, -1.0)]
    in_common = [shared_share_with(visible, block) for block in blocks]
    allowed = gap_shared_share
    while True:
        trains = [~block & (share <= allowed) for block, share in zip(blocks, in_common, strict=True)]
        best = int(np.argmax([train.sum() for train in trains]))
        if trains[best].sum() >= min(least_train, count - size) or allowed >= 1:
            break
        allowed = min(1.0, round(allowed + _RELAXED_BY, 6))
    role = np.where(trains[best], Role.TRAIN, Role.GAP).astype("<U7")
    role[blocks[best]] = Role.SUPPORT
    role[_targets(blocks[best], photo_id)] = Role.TARGET
    return Split(role, allowed)


def shared_share_with(visible: sparse.csr_array, block: Bool[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the share of each view's points that some view of the block sees too."""
    seen_by_block = (visible[np.flatnonzero(block)].sum(axis=0) > 0).astype(np.int32)
    own = visible.sum(axis=1)
    return (visible @ seen_by_block) / np.maximum(own, 1)


def main_axis(positions: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " 2"]:
    """Return the unit direction of greatest spread, its larger component positive."""
    axis = np.linalg.svd(positions - positions.mean(axis=0), full_matrices=False)[2][0]
    return axis if axis[np.argmax(np.abs(axis))] > 0 else -axis


def _block(
    look_in_world: Float[np.ndarray, "n 2"], photo_id: Int[np.ndarray, " n"], size: int, end: float
) -> Bool[np.ndarray, " n"]:
    along = look_in_world @ main_axis(look_in_world)
    block = np.zeros(len(along), bool)
    block[np.lexsort((photo_id, -end * along))[:size]] = True
    return block


def _targets(block: Bool[np.ndarray, " n"], photo_id: Int[np.ndarray, " n"]) -> Int[np.ndarray, " t"]:
    """Return every third view of the block in capture order, from its second."""
    views = np.flatnonzero(block)
    return views[np.argsort(photo_id[views], kind="stable")][1::_EVERY_THIRD]
