"""Choose the pairs of photographs that are worth comparing.

Positions are believed only as far as the photographs bear them out. Every photograph is compared with its neighbours by
GPS. Those that do not look more like these than like others, or hang together with a part of the scene only, are compared
coarsely with others, and then fully with those they look most like: with all of few; else with those whose vectors are most
alike (`retrieval`), and with what looks like these. Without GPS that goes for every photograph.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree
from scipy.spatial import KDTree

from aug3d_core.geometry.geodesy import enu_from_geodetic, middle_of
from aug3d_core.run.errors import InputError
from aug3d_core.sfm.coarse import ALIKE, Look
from aug3d_core.sfm.config import MatchingConfig

_BLOCK = 20
_IN_SEQUENCE = 2
_SPANNING_TREES = 3  # a coarse likeness may be wrong, so parts of a scene are joined by more than one
_LEAST_CHANCE = 0.6  # one half is what wrong positions give; on the town, right ones gave each photograph 0.68 or more
_FEW = 128  # others that a photograph is compared coarsely with, all of them
_SHORTLIST = 16  # those it is compared with first, where they are more
_HOPS, _ALIKE_HOPS = 2, 8  # then those that look like its 8 most alike


@dataclass(frozen=True)
class Choice:
    """Which pairs (i < j, of photo ids) to compare, how they were chosen, and the photographs whose GPS was not enough."""

    pairs: Int[np.ndarray, "m 2"]
    by: str
    doubted: Int[np.ndarray, " d"]


@dataclass(frozen=True)
class Scored:
    """Distinct pairs (i < j) that were compared coarsely, and how many features match."""

    pairs: Int[np.ndarray, "m 2"]
    scores: Int[np.ndarray, " m"]

    def with_new(self, pairs: Int[np.ndarray, "k 2"], look: Look) -> Scored:
        """Return these with the others of some pairs, which are compared."""
        pairs = _distinct(pairs)
        count = int(max(pairs.max(initial=0), self.pairs.max(initial=0))) + 1
        new = pairs[~np.isin(_number(pairs, count), _number(self.pairs, count))]
        return Scored(np.concatenate([self.pairs, new]), np.concatenate([self.scores, look.compare(new)]))


def choose_pairs(photos: pd.DataFrame, config: MatchingConfig, look: Look) -> Choice:
    """Choose pairs; `by` is `exhaustive`, `gps`, `coarse`, or `gps and coarse`. Raises InputError without the GPS asked for."""
    enu = gps_positions(photos)[0]
    located = np.isfinite(enu[:, 0])
    nobody = np.zeros(0, int)
    few = config.pairs == "auto" and len(photos) <= config.exhaustive_limit
    if few or config.pairs == "exhaustive" or len(photos) < 3:
        return Choice(exhaustive_pairs(len(photos)), "exhaustive", nobody)
    if config.pairs == "gps":
        if located.sum() < 2:
            raise InputError(
                f"matching.pairs=gps, but {located.sum()} of {len(photos)} photographs have GPS",
                "Use matching.pairs=auto, which needs no GPS.",
            )
        near = neighbour_pairs(enu[:, :2], config.neighbours)
        return Choice(_distinct(np.concatenate([near, sequence_pairs(len(photos))])), "gps", nobody)
    if config.pairs == "coarse" or located.sum() < 2:
        return Choice(_looked_up(len(photos), np.arange(len(photos)), config, look), "coarse", nobody)
    return _checked(enu[:, :2], config, look)


def _checked(positions_m: Float[np.ndarray, "n 2"], config: MatchingConfig, look: Look) -> Choice:
    """Return the neighbours by GPS, and more for the photographs that do not look like theirs."""
    count = len(positions_m)
    near, far = neighbour_pairs(positions_m, config.neighbours), drawn_pairs(count, config)
    far = far[~np.isin(_number(far, count), _number(near, count))]
    near_scores = look.compare(near)
    doubted = doubtful(near, near_scores, far, look.compare(far), count)
    chosen = np.concatenate([near, sequence_pairs(count)])
    if not len(doubted):
        return Choice(_distinct(chosen), "gps", doubted)
    more = _looked_up(count, doubted, config, look, Scored(near, near_scores))
    return Choice(_distinct(np.concatenate([chosen, more])), "gps and coarse", doubted)


def doubtful(
    near: Int[np.ndarray, "m 2"],
    near_scores: Int[np.ndarray, " m"],
    far: Int[np.ndarray, "k 2"],
    far_scores: Int[np.ndarray, " k"],
    count: int,
) -> Int[np.ndarray, " d"]:
    """Return the photographs that do not look more like their neighbours than like others, or not like the larger part.

    The first is the chance that a neighbour scores higher than another photograph (the area under the ROC curve); the second
    follows pairs that are alike beyond doubt.
    """
    near_of, far_of = _by_photo(near, near_scores, count), _by_photo(far, far_scores, count)
    borne_out = np.array([_chance_higher(*scores) > _LEAST_CHANCE for scores in zip(near_of, far_of, strict=True)])
    alike = near[near_scores >= ALIKE]
    graph = coo_array((np.ones(len(alike)), (alike[:, 0], alike[:, 1])), shape=(count, count))
    part = connected_components(graph, directed=False)[1]
    return np.flatnonzero(~borne_out | (part != np.bincount(part).argmax()))


def drawn_pairs(count: int, config: MatchingConfig) -> Int[np.ndarray, "m 2"]:
    """Return pairs of each photograph with others drawn at random."""
    rng = np.random.default_rng(config.seed)
    drawn = [rng.choice(count, min(config.neighbours, count), replace=False) for _ in range(count)]
    return _distinct(np.stack([np.repeat(np.arange(count), len(drawn[0])), np.concatenate(drawn)], axis=1))


def _looked_up(
    count: int, wanted: Int[np.ndarray, " w"], config: MatchingConfig, look: Look, known: Scored | None = None
) -> Int[np.ndarray, "m 2"]:
    """Return the pairs of each wanted photograph with those it looks most like among all, and what joins all parts."""
    if count - 1 <= _FEW:
        pairs = _distinct(np.stack([np.repeat(wanted, count), np.tile(np.arange(count), len(wanted))], axis=1))
        found = Scored(pairs, look.compare(pairs))
    else:
        found = _explored(count, wanted, look, known or Scored(np.zeros((0, 2), int), np.zeros(0, int)))
    most = most_alike(found.pairs, found.scores, wanted, config.neighbours)
    joining = joining_pairs(found.pairs, found.scores, count)
    return _distinct(np.concatenate([most, joining, sequence_pairs(count)]))


def _explored(count: int, wanted: Int[np.ndarray, " w"], look: Look, known: Scored) -> Scored:
    """Compare a shortlist, then those that look like the ones that look like a photograph, and these again.

    So photographs that are beside each other are found from a few of them (Dong et al. 2011, "Efficient k-nearest neighbor
    graph construction"): on a town of 330 photographs a seventh of all pairs were compared, and 97.6 % of those that see 50
    points together were among the 20 most alike; after comparing all, 96.5 %.
    """
    found = known.with_new(np.concatenate([look.shortlist(wanted, _SHORTLIST), sequence_pairs(count)]), look)
    for _ in range(_HOPS):
        like = found.scores > 0
        i, j = most_alike(found.pairs[like], found.scores[like], np.arange(count), _ALIKE_HOPS).T
        near = coo_array((np.ones(len(i)), (i, j)), shape=(count, count)).tocsr()
        near = near + near.T
        reached = np.stack((near @ near).nonzero(), axis=1)
        found = found.with_new(reached[np.isin(reached, wanted).any(axis=1)], look)
    return found


def most_alike(
    pairs: Int[np.ndarray, "m 2"], scores: Int[np.ndarray, " m"], wanted: Int[np.ndarray, " w"], neighbours: int
) -> Int[np.ndarray, "k 2"]:
    """Return, of distinct pairs, those of each wanted photograph with the highest scores; among equals, the first."""
    photo, other = np.concatenate([pairs, pairs[:, ::-1]]).T
    score = np.tile(scores, 2)
    order = np.lexsort((other, -score, photo))
    order = order[np.isin(photo[order], wanted)]
    photo, other = photo[order], other[order]
    first = np.searchsorted(photo, photo)  # of this photograph
    best = np.arange(len(photo)) - first < neighbours
    return np.stack([photo[best], other[best]], axis=1)


def joining_pairs(pairs: Int[np.ndarray, "m 2"], scores: Int[np.ndarray, " m"], count: int) -> Int[np.ndarray, "k 2"]:
    """Return three spanning trees (or forests) of the highest scores that have no pair in common."""
    left = scores > 0
    trees = [np.zeros((0, 2), int)]
    for _ in range(_SPANNING_TREES):
        i, j = pairs[left].T
        costs = coo_array((1 / scores[left], (i, j)), shape=(count, count))
        tree = np.stack(minimum_spanning_tree(costs.tocsr()).nonzero(), axis=1)
        left &= ~np.isin(_number(pairs, count), _number(tree, count))
        trees.append(tree)
    return np.concatenate(trees)


def exhaustive_pairs(count: int) -> Int[np.ndarray, "m 2"]:
    """Return all pairs, block by block, so that the features of few photographs are in use at a time."""
    i, j = np.triu_indices(count, k=1)
    order = np.lexsort((j, i, j // _BLOCK, i // _BLOCK))
    return np.stack([i, j], axis=1)[order]


def sequence_pairs(count: int) -> Int[np.ndarray, "m 2"]:
    """Return the pairs of each photograph with the next ones in capture order."""
    steps = range(1, min(_IN_SEQUENCE, count - 1) + 1)
    return np.concatenate([np.stack([np.arange(count - step), np.arange(step, count)], axis=1) for step in steps])


def neighbour_pairs(positions_m: Float[np.ndarray, "n 2"], neighbours: int) -> Int[np.ndarray, "m 2"]:
    """Return the pairs of each photograph with its nearest ones; a row of NaN is one without a position, which has none."""
    located = np.flatnonzero(np.isfinite(positions_m).all(axis=1))
    most = min(neighbours + 1, len(located))  # a photograph is its own nearest
    nearest = np.asarray(KDTree(positions_m[located]).query(positions_m[located], k=most)[1])
    return _distinct(np.stack([np.repeat(located, most), located[nearest.ravel()]], axis=1))


def gps_positions(photos: pd.DataFrame) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, " 3"]]:
    """Return ENU metres about the photographs' median position, and that position (lat, lon, alt).

    Rows are NaN without GPS, and up is NaN without an altitude. The origin is NaN where nothing has GPS, and its altitude is 0
    where none has one.
    """
    geodetic = photos[["lat_deg", "lon_deg", "alt_m"]].to_numpy(float, copy=True)
    located = np.isfinite(geodetic[:, 0])
    if not located.any():
        return np.full_like(geodetic, np.nan), np.full(3, np.nan)
    measured = np.isfinite(geodetic[:, 2])
    median_alt = np.median(geodetic[located & measured, 2]) if (located & measured).any() else 0.0
    geodetic[located & ~measured, 2] = median_alt  # east and north hardly depend on it
    origin = middle_of(geodetic[located])
    enu = enu_from_geodetic(geodetic, origin)
    enu[~measured, 2] = np.nan
    return enu, origin


def _chance_higher(scores: Int[np.ndarray, " m"], others: Int[np.ndarray, " k"]) -> float:
    """Return the chance that a score is higher than one of the others, ties counting half; 1 if there are no others."""
    if not len(others):
        return 1.0
    if not len(scores):
        return 0.0
    return float((np.sign(scores[:, None] - others).mean() + 1) / 2)


def _by_photo(pairs: Int[np.ndarray, "m 2"], scores: Int[np.ndarray, " m"], count: int) -> list[Int[np.ndarray, " _"]]:
    photo, score = pairs.T.ravel(), np.tile(scores, 2)
    order = np.argsort(photo, kind="stable")
    return np.split(score[order], np.searchsorted(photo[order], np.arange(1, count)))


def _distinct(pairs: Int[np.ndarray, "m 2"]) -> Int[np.ndarray, "k 2"]:
    """Return the pairs with i < j, each once, sorted."""
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
    return pairs[pairs[:, 0] < pairs[:, 1]]


def _number(pairs: Int[np.ndarray, "m 2"], count: int) -> Int[np.ndarray, " m"]:
    return pairs[:, 0] * count + pairs[:, 1]
