"""Keep a block of ground for the test, with a gap around it, so that nothing is predicted that training has seen.

The ground that the views look at is cut across its longest direction, and one piece is the test block. Its views are
`support` (inputs at test time) or `target` (what is predicted). A view outside that looks within a footprint of where one
of the block looks, or shares too many points with the block, is `gap` and used by nobody in training; the rest is `train`.

A single split takes an end of the ground. Where that would test too few photographs to say anything, the whole ground is
cut into folds: each is the test block of a data set and a model of its own, and the figures are taken over all of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import sparse

from aug3d_core.geometry.footprint import footprints_apart
from aug3d_core.run.errors import InputError

LEAST_TARGETS = 3  # fewer photographs in the test say nothing: then there are folds
_EVERY_THIRD = 3
_LEAST_FOLD = 5  # views: two targets, and the three inputs that the model is given
_LEAST_TRAIN_SHARE = 0.35


@runtime_checkable
class SplitSettings(Protocol):
    """The settings of a split; `GroupingConfig` says what each means."""

    @property
    def test_share(self) -> float: ...
    @property
    def folds(self) -> int | None: ...
    @property
    def fold(self) -> int: ...
    @property
    def gap_footprints(self) -> float: ...
    @property
    def gap_shared_share(self) -> float: ...


class Role(StrEnum):
    """What a view is used for."""

    TRAIN = "train"
    GAP = "gap"
    SUPPORT = "support"
    TARGET = "target"


@dataclass(frozen=True)
class Split:
    """The role of each view, the number of folds this is one of, and how far the gap had to be narrowed.

    narrowed: 0 where the gap is as wide as asked, 1 where there is none.
    """

    role: np.ndarray  # (n,) of str
    folds: int
    narrowed: float

    def views(self, *roles: Role) -> Int[np.ndarray, " m"]:
        """Return the views that have one of the roles."""
        return np.flatnonzero(np.isin(self.role, [str(role) for role in roles]))


def split_views(
    look_in_world: Float[np.ndarray, "n 2"],
    footprint: Float[np.ndarray, " n"],
    photo_id: Int[np.ndarray, " n"],
    visible: sparse.csr_array,
    config: SplitSettings,
) -> Split:
    """Split the views; `footprint` in world units, `visible` is views x points.

    If fewer than about a third (and at least 2) of the views are left for training, the gap is narrowed, in ground and in
    shared points alike, until they are; `Split.narrowed` says how far. A single split takes the end where that is less, then
    the one that leaves more for training.
    Raises InputError where there are too few views, or no such fold.
    """
    count = len(look_in_world)
    if count < 4:
        raise InputError(
            f"{count} views are too few for a test: it needs 2, and training needs 2",
            "Add photographs that overlap with the ones that could be placed.",
        )
    folds = _folds(count, config)
    least = max(2, round(_LEAST_TRAIN_SHARE * count))
    cuts = []
    for block in _blocks(look_in_world, photo_id, folds, config):
        needed = _narrowing(block, look_in_world, footprint, visible, config)
        narrowed = float(np.sort(needed)[min(least, count - int(block.sum())) - 1])
        cuts.append((block, needed <= narrowed, narrowed))
    block, train, narrowed = min(cuts, key=lambda cut: (cut[2], -cut[1].sum()))
    role = np.where(train, Role.TRAIN, Role.GAP).astype("<U7")
    role[block] = Role.SUPPORT
    role[_targets(block, photo_id)] = Role.TARGET
    return Split(role, folds, narrowed)


def shared_share_with(visible: sparse.csr_array, block: Bool[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the share of each view's points that some view of the block sees too."""
    seen_by_block = (visible[np.flatnonzero(block)].sum(axis=0) > 0).astype(np.int32)
    own = visible.sum(axis=1)
    return (visible @ seen_by_block) / np.maximum(own, 1)


def main_axis(positions: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " 2"]:
    """Return the unit direction of greatest spread, its larger component positive."""
    axis = np.linalg.svd(positions - positions.mean(axis=0), full_matrices=False)[2][0]
    return axis if axis[np.argmax(np.abs(axis))] > 0 else -axis


def _folds(count: int, config: SplitSettings) -> int:
    """Return the number of folds: as asked, or one where a single split tests enough."""
    folds = config.folds
    if folds is None:
        enough = len(range(1, _block_size(count, config), _EVERY_THIRD)) >= LEAST_TARGETS
        folds = 1 if enough else max(1, min(round(1 / config.test_share), count // _LEAST_FOLD))
    if folds > count // 2:
        raise InputError(
            f"{count} views cannot be cut into grouping.folds = {folds}: each needs 2 for its test",
            f"Set grouping.folds to at most {count // 2}, or leave it out.",
        )
    if config.fold >= folds:
        raise InputError(
            f"there is no grouping.fold {config.fold}: the scene has {folds}, counted from 0",
            f"Set grouping.fold to at most {folds - 1}, or leave it out.",
        )
    return folds


def _block_size(count: int, config: SplitSettings) -> int:
    return min(max(2, round(config.test_share * count)), count - 2)


def _blocks(
    look_in_world: Float[np.ndarray, "n 2"], photo_id: Int[np.ndarray, " n"], folds: int, config: SplitSettings
) -> list[Bool[np.ndarray, " n"]]:
    """Return the blocks to choose from: both ends for a single split, else the one of the fold."""
    along = look_in_world @ main_axis(look_in_world)
    if folds > 1:
        chosen = [np.array_split(np.lexsort((photo_id, along)), folds)[config.fold]]
    else:
        size = _block_size(len(along), config)
        chosen = [np.lexsort((photo_id, -end * along))[:size] for end in (+1.0, -1.0)]
    return [np.isin(np.arange(len(along)), block) for block in chosen]


def _narrowing(
    block: Bool[np.ndarray, " n"],
    look_in_world: Float[np.ndarray, "n 2"],
    footprint: Float[np.ndarray, " n"],
    visible: sparse.csr_array,
    config: SplitSettings,
) -> Float[np.ndarray, " n"]:
    """Return how far the gap must be narrowed for each view to be trained on: 0 not at all, 1 to nothing; inf in the block.

    A gap narrowed by x is (1 - x) times as many footprints wide as asked, and allows the share of points in common that
    lies x of the way from what was asked to all.
    """
    outside = np.flatnonzero(~block)
    apart = footprints_apart(look_in_world, footprint, outside, np.flatnonzero(block)).min(axis=1)
    share = shared_share_with(visible, block)[outside]
    needed = np.full(len(block), np.inf)
    needed[outside] = np.maximum(
        np.clip(1 - apart / config.gap_footprints, 0, 1),
        np.clip(share - config.gap_shared_share, 0, 1) / max(1 - config.gap_shared_share, np.finfo(float).tiny),
    )
    return needed


def _targets(block: Bool[np.ndarray, " n"], photo_id: Int[np.ndarray, " n"]) -> Int[np.ndarray, " t"]:
    """Return every third view of the block in capture order, from its second."""
    views = np.flatnonzero(block)
    return views[np.argsort(photo_id[views], kind="stable")][1::_EVERY_THIRD]
