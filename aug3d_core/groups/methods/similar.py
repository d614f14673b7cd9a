"""Group views by a matrix of similarities (0 to 1): what shared points and seen surface have in common."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

from aug3d_core.geometry.spread import farthest_points
from aug3d_core.groups.scene import GroupingScene


@dataclass(frozen=True)
class Likeness:
    """A similarity of every pair of views (n x n, 0 to 1), and the value from which two overlap."""

    similarity: sparse.csr_array
    overlaps: float


def group_by(
    likeness: Likeness, scene: GroupingScene, candidates: Int[np.ndarray, " m"], k: int, count: int
) -> Int[np.ndarray, "c k"]:
    """Return groups around centres spread over where the candidates look.

    Centres are views that overlap with K - 1 others at least. A view that is then in no group is a centre too, if half of its
    group overlaps with it. Where no view overlaps with K - 1, those with half as many are centres, and else any.
    """
    partners, rows = _partners(likeness, candidates), []
    for least in (k - 1, (k - 1) / 2, 0):
        able = candidates[partners >= least]
        if not len(able) or (rows and least == 0):
            continue
        first, held = not rows, {view for row in rows for view in row.tolist()}
        for centre in able[farthest_points(scene.look_in_world[able], count)].tolist():
            if len(rows) < count and (first or centre not in held):
                rows.append(most_similar(likeness, scene, centre, candidates, k))
                held.update(rows[-1].tolist())
    return np.stack(rows)


def lonely(likeness: Likeness, candidates: Int[np.ndarray, " m"], k: int) -> Int[np.ndarray, " x"]:
    """Return the candidates that overlap with fewer than half of K - 1 others."""
    return candidates[2 * _partners(likeness, candidates) < k - 1]


def _partners(likeness: Likeness, candidates: Int[np.ndarray, " m"]) -> Int[np.ndarray, " m"]:
    """Return with how many others each candidate overlaps."""
    among = likeness.similarity[candidates][:, candidates]
    return np.asarray((among >= likeness.overlaps).sum(axis=1)).ravel() - (among.diagonal() >= likeness.overlaps)


def most_similar(
    likeness: Likeness, scene: GroupingScene, centre: int, candidates: Int[np.ndarray, " m"], k: int
) -> Int[np.ndarray, " k"]:
    """Return a view and the k - 1 other candidates that are most similar to it.

    Of views taken in one pose only the most similar comes in while others that overlap are to be had. Among equals, and
    so among those with no similarity, the one that looks nearest comes first, then the earlier photo.
    """
    similarity, allowed = likeness.similarity, np.zeros(len(scene.views), bool)
    allowed[candidates] = True
    allowed[centre] = False
    row = slice(similarity.indptr[centre], similarity.indptr[centre + 1])
    alike = np.zeros(len(allowed))
    alike[similarity.indices[row]] = similarity.data[row]
    partners = np.flatnonzero(allowed & (alike >= likeness.overlaps))
    first, twins = _apart(scene, centre, _ranked(scene, centre, partners, alike), k - 1)
    chosen = [centre, *first, *twins][:k]
    if len(chosen) < k:
        allowed[partners] = False
        chosen.extend(_ranked(scene, centre, np.flatnonzero(allowed), alike)[: k - len(chosen)])
    return np.array(chosen)


def _ranked(
    scene: GroupingScene, centre: int, views: Int[np.ndarray, " m"], alike: Float[np.ndarray, " n"]
) -> Int[np.ndarray, " m"]:
    away = np.linalg.norm(scene.look_in_world[views] - scene.look_in_world[centre], axis=1)
    return views[np.lexsort((scene.views.photo_id[views], away, -alike[views]))]


def _apart(scene: GroupingScene, centre: int, order: Int[np.ndarray, " m"], wanted: int) -> tuple[list[int], list[int]]:
    """Split views, best first, into those of a pose that is new in the group and the twins of earlier ones."""
    first, twins = [], []
    taken = set(scene.twins[centre])
    for view in order.tolist():
        if len(first) == wanted:
            break
        if view in taken:
            twins.append(view)
        else:
            first.append(view)
            taken.update(scene.twins[view])
    return first, twins
