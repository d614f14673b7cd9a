"""How well each place of a site is seen, and what one more photograph would add.

A photograph counts for a place by how squarely and how finely it shows it, and by whether the flight looks that way:
predictions are wanted of views like its own. Two photographs from the same side say no more than one. What is missing of a
place falls with the number n of photographs that count, as exp(-n / FADES). It weighs as much as the place fills of pictures
like those of the flight, and more where the model erred on test photographs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.advice.site import Site
from aug3d_core.domes.sight import DIRECTIONS, SPREAD
from aug3d_core.geometry.transforms import forward
from aug3d_core.geometry.views import Views

FADES = 2.0  # photographs: with two more, a third of what was missing is left
FEW = 3  # photographs that a prediction is made from
_STEEPEST, _SQUARE = 0.15, 0.5  # cosines to the normal: seen at all; seen as well as from above
_FINE = 1.4  # flight heights: farther away a place is seen less finely than the flight shows it
_LEAST_WORTH = 0.1  # of a wall that pictures like the flight's hardly show
_LOOKS = 32  # of the flight, that say what its pictures show
_ASIDE = (
    20.0  # times 1 - cosine: 18 degrees beside the flight's directions a look counts 1/e, as inputs of predictions do
)
_LEAST_ALIKE = 0.25  # of a look that is nothing like the flight's: it still shows walls


class Look(NamedTuple):
    """What a camera shows: samples, the directions that it sees them from, and how much it counts for each (0 to 1)."""

    sample: Int[np.ndarray, " k"]
    direction: Int[np.ndarray, " k"]
    counts: Float[np.ndarray, " k"]


@dataclass(frozen=True)
class Need:
    """best: how much the best photograph from each direction counts. worth: of a sample, sums to 1.

    alike: how much a direction counts, 1 where the flight looks that way.
    """

    best: Float[np.ndarray, "s d"]
    worth: Float[np.ndarray, " s"]
    alike: Float[np.ndarray, " d"]

    @cached_property
    def seen(self) -> Float[np.ndarray, " s"]:
        """How many photographs count for each sample."""
        return self.best.sum(axis=1)

    @property
    def missing(self) -> float:
        """What is missing of the whole site, 0 to 1."""
        return float(self.worth @ missing(self.seen))

    def added(self, look: Look) -> Float[np.ndarray, " k"]:
        """Return how much less is missing of each sample of a look, by its worth."""
        more = self._more(look)
        before = self.seen[look.sample]
        return self.worth[look.sample] * (missing(before) - missing(before + more))

    def take(self, look: Look) -> None:
        """Count one more photograph."""
        more = self._more(look)
        self.best[look.sample, look.direction] += more
        self.seen[look.sample] += more

    def _more(self, look: Look) -> Float[np.ndarray, " k"]:
        counts = look.counts * self.alike[look.direction]
        return np.maximum(counts - self.best[look.sample, look.direction], 0.0)


def missing(photographs: Float[np.ndarray, " s"]) -> Float[np.ndarray, " s"]:
    """Return what is missing of places that so many photographs count for."""
    return np.exp(-photographs / FADES)


def need_of(site: Site, views: Views, error: Float[np.ndarray, " s"], progress: Callable[[int, int], None]) -> Need:
    """Return how well the photographs see a site. error: of the model at each sample, 1 where it is as usual."""
    looks = forward(views.cam_from_world)[:: max(len(views) // _LOOKS, 1)]
    square = np.maximum(site.samples.normal @ -looks.T, 0.0).mean(axis=1)
    worth = np.maximum(square, _LEAST_WORTH) * error
    seen = []
    for view in range(len(views)):
        seen.append(look_of(site, views.cam_from_world[view], views.intrinsics[view], views.size[view]))
        progress(view + 1, len(views))
    need = Need(np.zeros((len(worth), DIRECTIONS), np.float32), worth / worth.sum(), _alike(seen))
    for look in seen:
        need.take(look)
    return need


def _alike(looks: Sequence[Look]) -> Float[np.ndarray, " d"]:
    """Return how much each direction counts, by how near the flight's directions it lies."""
    often = np.bincount(np.concatenate([look.direction for look in looks]), minlength=DIRECTIONS)
    near = np.exp(_ASIDE * (SPREAD @ SPREAD.T - 1)) @ often
    return np.clip(2 * near / near.max(), _LEAST_ALIKE, 1.0).astype(np.float32)


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
    return Look(sample, (towards @ SPREAD.T).argmax(axis=1), counts.astype(np.float32))
