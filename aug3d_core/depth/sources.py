"""Which photographs each one is compared with: many shared points, seen from neither too near nor too far aside.

The score is MVSNet's (Yao et al. 2018, sec. 4.1): each shared point counts by a Gaussian of its triangulation angle, narrow
below the best angle, where depth becomes uncertain, and wide above it, where surfaces look different.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from aug3d_core.geometry.rows import Rows
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Points, Tracks, Views

BEST_DEG = 12.0
NARROW_DEG = 5.0
WIDE_DEG = 15.0
FEWEST_SHARED = 8  # points; fewer say nothing about overlap


def angle_weight(angle_deg: Float[np.ndarray, " *n"]) -> Float[np.ndarray, " *n"]:
    """Return how much a point seen under this triangulation angle counts, 1 at best."""
    width = np.where(angle_deg < BEST_DEG, NARROW_DEG, WIDE_DEG)
    return np.exp(-0.5 * ((angle_deg - BEST_DEG) / width) ** 2)


def scores(
    centre: Float[np.ndarray, "n 3"],
    xyz: Float[np.ndarray, "s 3"],
    other: Int[np.ndarray, " s"],
    view: int,
) -> Float[np.ndarray, " n"]:
    """Return the score of each view as a source of `view`; 0 without overlap.

    centre: of each view, in the world. xyz, other: points that `view` sees, and for each an other view that sees it too.
    """
    angle_deg = _angles_deg(xyz, centre[view], centre[other])
    score = np.bincount(other, angle_weight(angle_deg), minlength=len(centre)).astype(float)  # of nothing: integers
    score[np.bincount(other, minlength=len(centre)) < FEWEST_SHARED] = 0.0
    return score


def choose_sources(
    views: Views,
    points: Points,
    tracks: Tracks,
    given: Bool[np.ndarray, " n"],
    train: Bool[np.ndarray, " n"],
    most: int,
) -> dict[int, list[int]]:
    """Return the sources of each given view, best first: for a train view only train views, for others any given one.

    A view that overlaps with none has an empty list, and is no source: it will have no depth map.
    """
    chosen, centre = {}, centres(views.cam_from_world)
    by_view, by_point = Rows(tracks.view, len(views)), Rows(tracks.point, len(points.xyz))
    for view in np.flatnonzero(given).tolist():
        allowed = train if train[view] else given
        shared = by_point.having(np.unique(tracks.point[by_view.having(np.array([view]))]))
        shared = shared[allowed[tracks.view[shared]] & (tracks.view[shared] != view)]
        score = scores(centre, points.xyz[tracks.point[shared]], tracks.view[shared], view)
        order = np.lexsort((np.arange(len(score)), -score))[:most]
        chosen[view] = order[score[order] > 0].tolist()
    return _among_themselves(chosen)


def _among_themselves(chosen: dict[int, list[int]]) -> dict[int, list[int]]:
    """Leave views without a source out of the lists of others, until every view in a list has one of its own."""
    usable = {view for view, sources in chosen.items() if sources}
    left = {view: [source for source in sources if source in usable] for view, sources in chosen.items()}
    return left if left == chosen else _among_themselves(left)


def _angles_deg(
    xyz: Float[np.ndarray, "t 3"], here: Float[np.ndarray, " 3"], there: Float[np.ndarray, "t 3"]
) -> Float[np.ndarray, " t"]:
    to_here, to_there = here - xyz, there - xyz
    cosine = (to_here * to_there).sum(1) / (np.linalg.norm(to_here, axis=1) * np.linalg.norm(to_there, axis=1))
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))
