"""Keep a block of ground for the test, with a gap around it, so that nothing is predicted that training has seen.

The ground that the views look at is cut across its longest direction, and one piece is the test block. Its views are
`support` (inputs at test time) or `target` (what is predicted). A view outside that looks within a footprint of where one
of the block looks, or shares too many points with the block, is `gap` and used by nobody in training; the rest is `train`.
Grouping may find `spare` ones among `gap` and `train`: enough others show the same. A scene that grows keeps its test
(`earlier.py`), so that its figures compare.

A single split takes an end of the ground. Where that would test too few photographs to say anything, or leave a test that
training sees, both ends are taken: each is the test block of a data set and a model of its own, and the figures are taken
over both. An end has neighbours on one side only, so its gap can be wider than that of a block in the middle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import sparse

from aug3d_core.geometry.footprint import footprints_apart
from aug3d_core.run.errors import InputError

LEAST_TARGETS = 4  # the 95 % interval of three reaches 2.5 standard deviations to each side, that of four 1.6
MOST_NARROWED = 0.5  # a gap narrowed by more leaves a test that training sees
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
    SPARE = "spare"  # neither of the test nor needed: enough others show the same
    GAP = "gap"
    SUPPORT = "support"
    TARGET = "target"


@dataclass(frozen=True)
class HeldOut:
    """A test block, and which of its views are predicted."""

    block: Bool[np.ndarray, " n"]
    targets: Int[np.ndarray, " t"]


@dataclass(frozen=True)
class Split:
    """The role of each view, the number of folds this is one of, and what was found about an earlier test, if there is one."""

    role: np.ndarray  # (n,) of str
    folds: int
    kept: bool = False
    reason: str = ""

    def without(self, spare: Int[np.ndarray, " s"]) -> Split:
        """Return the split with these views spare."""
        role = self.role.copy()
        role[spare] = Role.SPARE
        return replace(self, role=role)

    def views(self, *roles: Role) -> Int[np.ndarray, " m"]:
        """Return the views that have one of the roles."""
        return np.flatnonzero(np.isin(self.role, [str(role) for role in roles]))


def split_views(
    look_in_world: Float[np.ndarray, "n 2"],
    footprint: Float[np.ndarray, " n"],
    photo_id: Int[np.ndarray, " n"],
    visible: sparse.csr_array,
    config: SplitSettings,
    earlier: HeldOut | None = None,
) -> Split:
    """Split the views; `footprint` in world units, `visible` is views x points. earlier: the test before the scene grew.

    An earlier test stays while its block holds half to twice the share that is asked for and its gap is not narrowed too far.

    If fewer than about a third (and at least 2) of the views are left for training, the gap is narrowed, in ground and in
    shared points alike, until they are. Of the ways to hold ground out, the first is taken
    that tests enough photographs behind a gap that is not narrowed too far; if there is none, the one with the widest gap.
    Raises InputError where there are too few views, or no such fold.
    """
    count = len(look_in_world)
    if count < 4:
        raise InputError(
            f"{count} views are too few for a test: it needs 2, and training needs 2",
            "Add photographs that overlap with the ones that could be placed.",
        )
    if config.folds is not None and config.folds > count // 2:
        raise InputError(
            f"{count} views cannot be cut into grouping.folds = {config.folds}: each needs 2 for its test",
            f"Set grouping.folds to at most {count // 2}, or leave it out.",
        )
    least = max(2, round(_LEAST_TRAIN_SHARE * count))

    def cut(block: Bool[np.ndarray, " n"]) -> _Cut:
        needed = _narrowing(block, look_in_world, footprint, visible, config)
        narrowed = float(np.sort(needed)[min(least, count - int(block.sum())) - 1])
        return _Cut(block, _targets(block, photo_id), needed <= narrowed, narrowed)

    reason = ""
    if earlier is not None:
        was = replace(cut(earlier.block), targets=earlier.targets)
        share = was.block.mean()
        held = f"the test block of before holds {share:.0%} of the photographs"
        reason = f"{held}, and its gap is narrowed by {was.narrowed:.0%}"
        if config.test_share / 2 <= share <= 2 * config.test_share and was.narrowed <= MOST_NARROWED:
            return Split(_roles(was), 1, kept=True, reason=reason)
    along = np.lexsort((photo_id, look_in_world @ main_axis(look_in_world)))
    cuts = _chosen(_ways(along, cut, config))
    if config.fold >= len(cuts):
        raise InputError(
            f"there is no grouping.fold {config.fold}: the scene has {len(cuts)}, counted from 0",
            f"Set grouping.fold to at most {len(cuts) - 1}, or leave it out.",
        )
    return Split(_roles(cuts[config.fold]), len(cuts), reason=reason)


@dataclass(frozen=True)
class _Cut(HeldOut):
    """A test block, the views that may be trained on, and how far the gap between them is narrowed."""

    train: Bool[np.ndarray, " n"]
    narrowed: float


def _roles(cut: _Cut) -> np.ndarray:
    role = np.where(cut.train, Role.TRAIN, Role.GAP).astype("<U7")
    role[cut.block] = Role.SUPPORT
    role[cut.targets] = Role.TARGET
    return role


def _ways(
    along: Int[np.ndarray, " n"], cut: Callable[[Bool[np.ndarray, " n"]], _Cut], config: SplitSettings
) -> list[list[_Cut]]:
    """Return the ways to hold ground out, each a cut for every fold, the cheapest first. along: the views along the ground."""
    count, views = len(along), np.arange(len(along))

    def ends(size: int) -> list[_Cut]:
        return [cut(np.isin(views, block)) for block in (along[-size:], along[:size])]

    if config.folds is not None and config.folds > 2:
        return [[cut(np.isin(views, block)) for block in np.array_split(along, config.folds)]]
    size = min(max(2, round(config.test_share * count)), count - 2)
    single = [min(ends(size), key=lambda end: (end.narrowed, -end.train.sum()))]
    if config.folds == 1 or (config.folds is None and count < 2 * _LEAST_FOLD):
        return [single]
    small = min(_LEAST_FOLD, count // 2)
    both = [ends(size) for size in sorted({min(max(size, small), count // 2), small}, reverse=True)]
    return both if config.folds == 2 else [single, *both]


def _chosen(ways: list[list[_Cut]]) -> list[_Cut]:
    """Return the first way that says enough; without one, that with the widest gaps, if need be with few photographs."""
    tested = [way for way in ways if sum(len(cut.targets) for cut in way) >= LEAST_TARGETS]
    sound = [way for way in tested if max(cut.narrowed for cut in way) <= MOST_NARROWED]
    return sound[0] if sound else min(tested or ways, key=lambda way: max(cut.narrowed for cut in way))


def shared_share_with(visible: sparse.csr_array, block: Bool[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the share of each view's points that some view of the block sees too."""
    seen_by_block = (visible[np.flatnonzero(block)].sum(axis=0) > 0).astype(np.int32)
    own = visible.sum(axis=1)
    return (visible @ seen_by_block) / np.maximum(own, 1)


def main_axis(positions: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " 2"]:
    """Return the unit direction of greatest spread, its larger component positive."""
    axis = np.linalg.svd(positions - positions.mean(axis=0), full_matrices=False)[2][0]
    return axis if axis[np.argmax(np.abs(axis))] > 0 else -axis


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
