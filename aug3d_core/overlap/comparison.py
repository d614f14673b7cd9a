"""Every way of grouping on the same views, measured alike.

Each way may use every placed view and is asked for the same number of groups, at its default settings, at K = 10 and 20
(as in the paper) and at the scene's own K. Beside them stand the scene's own groups (training views only), its test groups,
and `best`: around the centres of `shared`, the K - 1 views of greatest true overlap - what no choice of members can beat.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Int

from aug3d_core.groups.config import GroupingConfig
from aug3d_core.groups.methods import METHODS
from aug3d_core.groups.scene import GroupingScene
from aug3d_core.overlap.config import OverlapConfig
from aug3d_core.overlap.measures import measure, member_overlaps, pairs_within
from aug3d_core.overlap.pair_overlaps import PairOverlaps
from aug3d_core.run.errors import InputError

SIZES = (10, 20)  # the paper's K
OWN, TEST, BEST = "scene", "test", "best"
_AROUND = "shared"  # whose centres `best` takes

Measure = Callable[[Int[np.ndarray, "m 2"]], PairOverlaps]  # pairs of views -> their true overlaps


@dataclass(frozen=True)
class Grouped:
    """The groups that one way makes at one K, centre first."""

    method: str
    members: Int[np.ndarray, "c k"]

    @property
    def k(self) -> int:
        """Views in a group."""
        return self.members.shape[1]


@dataclass(frozen=True)
class Comparison:
    """All groups, the overlaps of every pair in them, and why a way made none."""

    grouped: tuple[Grouped, ...]
    overlaps: PairOverlaps
    refused: tuple[str, ...]

    def at(self, k: int) -> dict[str, Grouped]:
        """Return what each way made at one K, the scene's own groups left out."""
        return {g.method: g for g in self.grouped if g.k == k and g.method not in (OWN, TEST)}

    def own(self, name: str) -> Grouped:
        """Return the scene's own groups, or its test groups."""
        return next(g for g in self.grouped if g.method == name)


def compare(scene: GroupingScene, own: Grouped, test: Grouped, config: OverlapConfig, measured: Measure) -> Comparison:
    """Group the views in every way, and measure the overlaps that the figures need."""
    made, refused = [], []
    for k in sorted({own.k, *SIZES}):
        if k > len(scene.views):
            continue
        for method in METHODS:
            try:
                made.append(Grouped(method, _groups(scene, method, k, config)))
            except InputError as error:
                refused.append(f"{method} makes no groups of {k}: {error.problem}")
    around = {g.k: g.members[:, 0] for g in made if g.method == _AROUND}
    wanted = [pairs_within(g.members) for g in (own, test, *made)]
    wanted += [_star(centres, len(scene.views)) for centres in around.values()]
    overlaps = measured(np.concatenate(wanted))
    best = [Grouped(BEST, most_overlapping(overlaps, centres, k)) for k, centres in around.items()]
    overlaps = overlaps.joined(measured(np.concatenate([pairs_within(g.members) for g in best])))
    return Comparison((own, test, *made, *best), overlaps, tuple(refused))


def most_overlapping(overlaps: PairOverlaps, centres: Int[np.ndarray, " c"], k: int) -> Int[np.ndarray, "c k"]:
    """Return each centre and the k - 1 views that overlap most with it; views that cannot be judged come last."""
    rows = []
    for centre in centres.tolist():
        others = np.delete(np.arange(overlaps.views), centre)
        value = np.nan_to_num(overlaps.of(np.full(len(others), centre), others), nan=-1.0)
        rows.append([centre, *others[np.argsort(-value, kind="stable")[: k - 1]]])
    return np.array(rows)


def summary_table(comparison: Comparison, scene: GroupingScene, candidates: int) -> pd.DataFrame:
    """Return one row of figures for each way and K; the scene's own groups had `candidates` views to choose from."""
    rows: list[dict[str, Any]] = []
    for grouped in comparison.grouped:
        views = candidates if grouped.method == OWN else len(scene.views)
        figures = measure(grouped.members, scene.shared, comparison.overlaps, views)
        rows.append({"method": grouped.method, **figures})
    return pd.DataFrame(rows)


def member_table(comparison: Comparison, scene: GroupingScene) -> pd.DataFrame:
    """Return one row for each member of each group but its centre: what it shares and how it overlaps with the centre."""
    photo_id, tables = scene.views.photo_id, []
    for grouped in comparison.grouped:
        count, k = grouped.members.shape
        centre, member = np.repeat(grouped.members[:, 0], k - 1), grouped.members[:, 1:].ravel()
        columns = {
            "method": grouped.method,
            "k": k,
            "group": np.repeat(np.arange(count), k - 1),
            "centre_photo_id": photo_id[centre],
            "photo_id": photo_id[member],
            "shared_points": np.asarray(scene.shared[centre, member]).ravel(),
            "overlap": member_overlaps(grouped.members, comparison.overlaps).ravel(),
        }
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)


def _groups(scene: GroupingScene, method: str, k: int, config: OverlapConfig) -> Int[np.ndarray, "c k"]:
    rng = np.random.default_rng(config.seed)
    return METHODS[method](scene, np.arange(len(scene.views)), k, config.groups, GroupingConfig(), rng)


def _star(centres: Int[np.ndarray, " c"], views: int) -> Int[np.ndarray, "m 2"]:
    """Return every pair of a centre with another view."""
    pairs = np.stack(np.meshgrid(centres, np.arange(views), indexing="ij"), axis=-1).reshape(-1, 2)
    return pairs[pairs[:, 0] != pairs[:, 1]]
