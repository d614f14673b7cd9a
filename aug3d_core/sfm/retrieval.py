"""Find the photographs that may show the same ground, by one vector for each: no pair of photographs is compared for it.

The vector sums, for each of some typical descriptors, how the photograph's descriptors near it differ from it (VLAD: Jegou et
al. 2010, "Aggregating local descriptors into a compact image representation"; each sum has unit length, as in Arandjelovic and
Zisserman 2013, "All about VLAD"). Photographs that see the same have vectors with a large product. All products are between
whole numbers and stay below 2^24, so single precision is exact and any number of threads gives the same answer.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int, UInt8

from aug3d_core.run.stage import Progress

_TYPICAL = 64
_ROUNDS = 5
_SAMPLE = 20_000
_LENGTH = 2048.0  # of a vector: products are at most its square, 2^22
_ROWS = 256  # photographs that are looked up at a time


def vectors(descriptors: Sequence[UInt8[np.ndarray, "_ 128"]], seed: int, progress: Progress) -> Int[np.ndarray, "n d"]:
    """Return a vector of whole numbers for each photograph; zeros for one without descriptors."""
    typical = _typical(descriptors, np.random.default_rng(seed))
    found = np.zeros((len(descriptors), typical.size), np.int16)
    for at, own in enumerate(descriptors):
        found[at] = _vector(own.astype(np.float32), typical)
        if at % _ROWS == _ROWS - 1 or at == len(descriptors) - 1:
            progress(at + 1, len(descriptors), "photographs summed up")
    return found


def candidates(found: Int[np.ndarray, "n d"], wanted: Int[np.ndarray, " w"], most: int) -> Int[np.ndarray, "m 2"]:
    """Return the pairs of each wanted photograph with the `most` others whose vectors are most like its own."""
    every = found.astype(np.float32)
    most = min(most, len(found) - 1)
    pairs = []
    for first in range(0, len(wanted), _ROWS):
        rows = wanted[first : first + _ROWS]
        likeness = every[rows] @ every.T
        likeness[:, ~found.any(axis=1)] = -(_LENGTH**2)  # without descriptors
        likeness[np.arange(len(rows)), rows] = -np.inf  # itself
        best = np.argsort(-likeness, axis=1, kind="stable")[:, :most]
        pairs.append(np.stack([np.repeat(rows, most), best.ravel()], axis=1))
    return np.concatenate(pairs) if pairs else np.zeros((0, 2), int)


def _typical(descriptors: Sequence[UInt8[np.ndarray, "_ 128"]], rng: np.random.Generator) -> Float[np.ndarray, "k 128"]:
    """Return typical descriptors, rounded: k-means of a sample."""
    each = max(_SAMPLE // max(len(descriptors), 1), 1)
    drawn = [
        own[rng.permutation(len(own))[:each]]
        for own in (descriptors[at] for at in rng.permutation(len(descriptors))[:_SAMPLE])
    ]
    sample = np.concatenate(drawn).astype(np.float32) if drawn else np.zeros((0, 128), np.float32)
    typical = sample[rng.permutation(len(sample))[:_TYPICAL]]
    for _ in range(_ROUNDS):
        nearest = _nearest(sample, typical)
        counts = np.bincount(nearest, minlength=len(typical))
        sums = np.zeros(typical.shape)
        np.add.at(sums, nearest, sample)
        typical = np.where(counts[:, None] > 0, np.rint(sums / np.maximum(counts, 1)[:, None]), typical).astype(
            np.float32
        )
    return typical


def _nearest(of: Float[np.ndarray, "n 128"], typical: Float[np.ndarray, "k 128"]) -> Int[np.ndarray, " n"]:
    if not len(typical):
        return np.zeros(len(of), int)
    return (of @ typical.T - (typical**2).sum(axis=1) / 2).argmax(axis=1)


def _vector(own: Float[np.ndarray, "n 128"], typical: Float[np.ndarray, "k 128"]) -> Int[np.ndarray, " d"]:
    nearest = _nearest(own, typical)
    sums = np.zeros(typical.shape)
    np.add.at(sums, nearest, own - typical[nearest])
    lengths = np.sqrt((sums**2).sum(axis=1, keepdims=True))
    unit = np.divide(sums, lengths, out=np.zeros_like(sums), where=lengths > 0)
    whole = np.sqrt(np.count_nonzero(lengths))
    return np.rint(unit.ravel() * (_LENGTH / whole if whole else 0.0)).astype(np.int16)
