"""What is missing of a site for predictions of views like the flight's, and what one more photograph would add.

A prediction of a place is as good as the photographs that look at it from about the same direction: how much one counts falls
with the angle between, and with how squarely and finely it shows the place. What is missing of a place, seen from a direction,
is exp(-n) for n photographs that count. A site is all its places from all directions that the flight looks from; they weigh as
much as they fill of pictures, and more where the model erred on test photographs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.advice.site import Site
from aug3d_core.domes.sight import sphere
from aug3d_core.geometry.views import Views

POOR = 0.5  # of a place missing: no photograph that counts, or hardly one
_SPREAD = 400  # directions of the whole sphere: neighbours are some 11 degrees apart
_NARROW = 20.0  # times 1 - cosine: from 18 degrees beside a direction one counts 1/e, as an input of predictions does
_USUAL = 0.5  # of how often the flight looks from its most usual direction: from rarer ones nothing is wanted
_STEEPEST, _SQUARE = 0.15, 0.5  # cosines to the normal: seen at all; seen as well as from above
_FINE = 1.4  # flight heights: farther away a place is seen less finely than the flight shows it


class Look(NamedTuple):
    """What a camera shows: samples, the unit vectors from them to it, and how much it counts for each (0 to 1)."""

    sample: Int[np.ndarray, " k"]
    towards: Float[np.ndarray, "k 3"]
    counts: Float[np.ndarray, " k"]


@dataclass(frozen=True)
class Need:
    """directions: from places to cameras, those that the flight looks from. seen: how many photographs count for each.

    worth: of a sample from a direction; the sum of all is 1.
    """

    directions: Float[np.ndarray, "d 3"]
    seen: Float[np.ndarray, "s d"]
    worth: Float[np.ndarray, "s d"]

    def missing_at(self) -> Float[np.ndarray, " s"]:
        """Return what is missing of each sample, over its directions, 0 to 1."""
        total = np.maximum(self.worth.sum(axis=1), np.finfo(np.float32).tiny)
        return (self.worth * np.exp(-self.seen)).sum(axis=1) / total

    @property
    def missing(self) -> float:
        """What is missing of the whole site, 0 to 1."""
        return float((self.worth * np.exp(-self.seen)).sum())

    def added(self, look: Look) -> Float[np.ndarray, " k"]:
        """Return how much less is missing of each sample of a look, by its worth."""
        left = self.worth[look.sample] * np.exp(-self.seen[look.sample])
        return (left * -np.expm1(-self._counts(look))).sum(axis=1)

    def take(self, look: Look) -> None:
        """Count one more photograph."""
        self.seen[look.sample] += self._counts(look)

    def _counts(self, look: Look) -> Float[np.ndarray, "k d"]:
        return look.counts[:, None] * np.exp(_NARROW * (look.towards @ self.directions.T - 1))


def need_of(site: Site, views: Views, error: Float[np.ndarray, " s"], progress: Callable[[int, int], None]) -> Need:
    """Return what is missing with the photographs that there are. error: of the model at each sample, 1 if as usual."""
    looks = []
    for view in range(len(views)):
        looks.append(look_of(site, views.cam_from_world[view], views.intrinsics[view], views.size[view]))
        progress(view + 1, len(views))
    directions = _looked_from(looks)
    square = site.samples.normal @ directions.T
    worth = np.where(square > _STEEPEST, square, 0.0) * error[:, None]
    need = Need(directions, np.zeros(worth.shape, np.float32), (worth / worth.sum()).astype(np.float32))
    for look in looks:
        need.take(look)
    return need


def _looked_from(looks: Sequence[Look]) -> Float[np.ndarray, "d 3"]:
    """Return the directions that the flight looks from at least now and then."""
    everywhere = sphere(_SPREAD).astype(np.float32)
    towards = np.concatenate([look.towards for look in looks])
    often = np.bincount((towards @ everywhere.T).argmax(axis=1), minlength=_SPREAD)
    near = np.exp(_NARROW * (everywhere @ everywhere.T - 1)) @ often
    return everywhere[near >= _USUAL * near.max()]


def look_of(
    site: Site,
    cam_from_world: Float[np.ndarray, "3 4"],
    intrinsics: Float[np.ndarray, " 4"],
    size: Int[np.ndarray, " 2"],
) -> Look:
    """Return what a camera shows of a site."""
    sample, depth, towards = site.samples.visible(site.surface, cam_from_world, intrinsics, size, _STEEPEST)
    square = np.einsum("kx,kx->k", towards, site.samples.normal[sample]) / _SQUARE
    fine = (_FINE * site.height / depth) ** 2
    counts = np.minimum(square, 1.0) * np.minimum(fine, 1.0)
    return Look(sample, towards.astype(np.float32), counts.astype(np.float32))
