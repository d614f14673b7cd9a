"""What is missing of views like the flight's, and what one more photograph would add.

A prediction is made from a few photographs. How much one counts for a place falls with the angle between its own direction and
the one that is asked for, and with how squarely and finely it shows the place. What is missing of a place is exp(-n) for n
photographs that count; of a view, the mean over what it shows, with the photographs that are best for it; of a site, the mean
over views like the flight's own, all over it. Places weigh more where the model erred on test photographs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import csc_array

from aug3d_core.advice.site import Site
from aug3d_core.domes.sight import Samples
from aug3d_core.geometry.transforms import centres

POOR = 0.75  # of a place missing: no more counts than three photographs from 20 degrees beside would
_INPUTS = 3  # photographs that a view is predicted from
_NARROW = 40.0  # times 1 - cosine: from 13 degrees beside a direction one counts 1/e
_STEEPEST, _SQUARE = 0.15, 0.5  # cosines to the normal: seen at all; seen as well as from above
_FINE = 1.4  # flight heights: farther away a place is seen less finely than the flight shows it


class Look(NamedTuple):
    """What a camera shows: samples, the unit vectors from them to it, and how much it counts for each (0 to 1)."""

    sample: Int[np.ndarray, " k"]
    towards: Float[np.ndarray, "k 3"]
    counts: Float[np.ndarray, " k"]


class Offer(NamedTuple):
    """Photographs that show some of a view, by number, and how much each counts for what the view shows."""

    photo: Int[np.ndarray, " c"]
    counts: Float[np.ndarray, "c k"]


@dataclass(frozen=True)
class Need:
    """asked: what each view shows. weight: of samples. inputs: how much the best photographs of each view count for it."""

    asked: Sequence[Look]
    weight: Float[np.ndarray, " s"]
    inputs: list[Float[np.ndarray, "i _"]]

    @property
    def missing(self) -> float:
        """What is missing of the whole site, 0 to 1."""
        return sum(map(self._missing_of, range(len(self.asked)))) / sum(
            float(self.weight[look.sample].mean()) for look in self.asked
        )

    def missing_at(self) -> Float[np.ndarray, " s"]:
        """Return what is missing of each sample, 0 to 1, over the views that show it; NaN where none does."""
        sample = np.concatenate([look.sample for look in self.asked])
        missing = np.concatenate([np.exp(-inputs.sum(axis=0)) for inputs in self.inputs])
        shown = np.bincount(sample, minlength=len(self.weight))
        total = np.bincount(sample, missing, minlength=len(self.weight))
        return np.divide(total, shown, out=np.full(len(shown), np.nan), where=shown > 0)

    def added(self, view: int, offer: Offer) -> Float[np.ndarray, " c"]:
        """Return how much less is missing of a view, by its weight, with each photograph in place of its worst input."""
        return np.maximum(self._missing_of(view) - self._with(view, offer.counts).min(axis=0), 0.0)

    def take(self, view: int, counts: Float[np.ndarray, " k"]) -> None:
        """Let a view be predicted from a photograph, in place of its worst input."""
        self.inputs[view][self._with(view, counts[None])[:, 0].argmin()] = counts

    def _missing_of(self, view: int) -> float:
        return float((np.exp(-self.inputs[view].sum(axis=0)) * self.weight[self.asked[view].sample]).mean())

    def _with(self, view: int, counts: Float[np.ndarray, "c k"]) -> Float[np.ndarray, "i c"]:
        inputs, weight = self.inputs[view], self.weight[self.asked[view].sample].astype(np.float32)
        others = inputs.sum(axis=0) - inputs
        return np.exp(-(others[:, None] + counts)) @ weight / len(weight)


def need_of(asked: Sequence[Look], looks: Sequence[Look], error: Float[np.ndarray, " s"]) -> Need:
    """Return what is missing with the photographs that there are. error: of the model at each sample, 1 if as usual."""
    need = Need(asked, error, [np.zeros((_INPUTS, len(look.sample)), np.float32) for look in asked])
    for view, offer in enumerate(offers(asked, looks)):
        for _ in range(min(_INPUTS, len(offer.photo))):
            best = int(need.added(view, offer).argmax())
            need.take(view, offer.counts[best])
            offer.counts[best] = 0
    return need


def offers(asked: Sequence[Look], photographs: Sequence[Look]) -> Iterator[Offer]:
    """Yield for each view the photographs that show some of it."""
    empty = np.zeros(0, int)
    sample = np.concatenate([empty, *(look.sample for look in photographs)])
    photo = np.repeat(np.arange(len(photographs)), [len(look.sample) for look in photographs])
    size = 1 + int(max((look.sample.max(initial=0) for look in (*asked, *photographs)), default=0))
    shown = csc_array((np.ones(len(sample), bool), (photo, sample)), (len(photographs), size))
    for view in asked:
        some = np.unique(shown[:, view.sample].indices)
        counts = [_counts(view, photographs[one]) for one in some]
        yield Offer(some, np.stack(counts) if counts else np.zeros((0, len(view.sample)), np.float32))


def _counts(view: Look, photograph: Look) -> Float[np.ndarray, " k"]:
    """Return how much a photograph counts for what a view shows."""
    _, here, there = np.intersect1d(view.sample, photograph.sample, assume_unique=True, return_indices=True)
    counts = np.zeros(len(view.sample), np.float32)
    cosine = np.einsum("kx,kx->k", view.towards[here], photograph.towards[there])
    counts[here] = photograph.counts[there] * np.exp(_NARROW * (cosine - 1))
    return counts


def look_of(
    site: Site,
    cam_from_world: Float[np.ndarray, "3 4"],
    intrinsics: Float[np.ndarray, " 4"],
    size: Int[np.ndarray, " 2"],
) -> Look:
    """Return what a camera shows of a site."""
    around, every = site.around(centres(cam_from_world)), site.samples
    samples = Samples(every.xyz[around], every.normal[around], every.triangle[around], every.limits)
    sample, depth, towards = samples.visible(site.surface, cam_from_world, intrinsics, size, _STEEPEST)
    square = np.einsum("kx,kx->k", towards, samples.normal[sample]) / _SQUARE
    fine = (_FINE * site.height / depth) ** 2
    counts = np.minimum(square, 1.0) * np.minimum(fine, 1.0)
    return Look(around[sample], towards.astype(np.float32), counts.astype(np.float32))
