"""The light that a lens loses towards the corners, told by points that photographs show at different places in the frame.

Photographs are evened out as they are undistorted: else the same roof is brighter in one than in the next, in depth's
colours, textures, the model and its test alike. The logarithm of the light is an even polynomial of the distance from the
middle (D. B. Goldman, Vignette and Exposure Calibration and Compensation, PAMI 2010). Exposures have no say: only how pairs of
photographs differ from one point to the next counts.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int, UInt8

from aug3d_core.geometry.robust import spread

_DARK, _BRIGHT = 8, 247  # levels beyond which a camera shows no differences
_FEWEST_PAIRS, _FEWEST_VIEWS = 500, 8
_PARTS = 8  # of the flight, left out in turn to tell how sure the light in the corners is
_ROUNDS = 8  # of weighting by the errors found: settled to four digits after six
_USUAL = 1.5  # standard deviations; errors beyond count the less (Huber)
_LEAST_LOSS = 0.03  # of the light in the corners, from which photographs are evened out
_SURE = 3.0  # standard deviations that it must be


@dataclass(frozen=True)
class Falloff:
    """The light at s = (t / corner)^2, of that in the middle, is exp(linear s + squared s^2); t: tangent of the angle off axis.

    corner: that tangent in a corner of the frame. sigma: standard deviation of the logarithm of the light there.
    """

    corner: float
    linear: float
    squared: float
    sigma: float

    @property
    def corner_light(self) -> float:
        """The light in the corners, against the middle."""
        return math.exp(self.linear + self.squared)

    @property
    def evened(self) -> bool:
        """Whether the corners surely lose enough for photographs to be evened out."""
        lost = -(self.linear + self.squared)
        return self.corner_light <= 1 - _LEAST_LOSS and lost >= _SURE * self.sigma

    def gain(self, size: tuple[int, int], intrinsics: Float[np.ndarray, " 4"]) -> Float[np.ndarray, "h w 1"]:
        """Return the factors that give an undistorted photograph as much light in its corners as in its middle.

        As a whole it stays as bright. size: width and height [px]. intrinsics: fx, fy, cx, cy [px].
        """
        fx, fy, cx, cy = intrinsics
        y, x = np.mgrid[: size[1], : size[0]] + 0.5
        s = (((x - cx) / fx) ** 2 + ((y - cy) / fy) ** 2) / self.corner**2
        gain = np.exp(-(self.linear * s + self.squared * s**2))
        return (gain / np.sqrt((gain**2).mean()))[..., None]  # so that an error of a picture stays as large as it was


def evened(picture: UInt8[np.ndarray, "h w 3"], gain: Float[np.ndarray, "h w 1"]) -> UInt8[np.ndarray, "h w 3"]:
    """Return a photograph with its gain."""
    return np.rint(picture * gain).clip(0, 255).astype(np.uint8)


def fit_falloff(
    point: Int[np.ndarray, " t"],
    view: Int[np.ndarray, " t"],
    grey: Float[np.ndarray, " t"],
    off_axis: Float[np.ndarray, " t"],
    corner: float,
) -> Falloff | None:
    """Return the falloff that makes points look alike wherever they stand in the frame; None if too few tell.

    Observation t: a view shows a point with that many levels of grey, off the axis by an angle of that tangent. corner: the
    tangent in the frame's corners.
    """
    views = int(view.max(initial=-1)) + 1
    order = np.lexsort((view, point))
    # No light has a ray beyond where a wide lens folds the picture over
    order = order[(grey[order] > _DARK) & (grey[order] < _BRIGHT) & np.isfinite(off_axis[order])]
    point, view, grey = point[order], view[order], grey[order]
    place = (off_axis[order] / corner) ** 2
    first = np.flatnonzero(point[1:] == point[:-1])  # each with the next that shows the same point
    if len(first) < _FEWEST_PAIRS or views < _FEWEST_VIEWS:
        return None
    brighter = np.log(grey[first] / grey[first + 1])
    further = np.stack([place[first] ** power - place[first + 1] ** power for power in (1, 2)], axis=1)
    _, pair = np.unique(view[first] * views + view[first + 1], return_inverse=True)
    importance = grey[first] * grey[first + 1]  # as errors of pictures count: by their square
    part = view[first] * _PARTS // views

    def fitted(terms: int, used: np.ndarray) -> Float[np.ndarray, " k"]:
        return _fitted(brighter[used], further[used, :terms], pair[used], importance[used])

    terms = 2
    whole = fitted(terms, np.full(len(first), True))
    if whole[0] > 0 or whole[0] + 2 * whole[1] > 0:  # brighter again somewhere: more than these points can tell
        terms = 1
        whole = fitted(terms, np.full(len(first), True))
    without = np.array([fitted(terms, part != left_out).sum() for left_out in range(_PARTS)])
    sigma = math.sqrt((_PARTS - 1) * without.var())  # jackknife
    linear, squared = (*map(float, whole), 0.0)[:2]
    return Falloff(corner, linear, squared, sigma)


def _fitted(
    brighter: Float[np.ndarray, " m"],
    further: Float[np.ndarray, "m k"],
    pair: Int[np.ndarray, " m"],
    importance: Float[np.ndarray, " m"],
) -> Float[np.ndarray, " k"]:
    """Return the factors of `further` that explain `brighter` but for what is the same for a whole pair of views."""
    weight = importance
    found = np.zeros(further.shape[1])
    for _ in range(_ROUNDS):
        total = np.bincount(pair, weight)
        told, places = (_without_mean(values, pair, weight, total) for values in (brighter[:, None], further))
        weighted = places * weight[:, None]
        found = np.linalg.lstsq(weighted.T @ places, weighted.T @ told[:, 0], rcond=None)[0]
        off = np.abs(told[:, 0] - places @ found)
        usual = spread(off)
        weight = importance / np.maximum(1, off / max(_USUAL * usual, 1e-9))
    return found


def _without_mean(
    values: Float[np.ndarray, "m k"],
    pair: Int[np.ndarray, " m"],
    weight: Float[np.ndarray, " m"],
    total: Float[np.ndarray, " p"],
) -> Float[np.ndarray, "m k"]:
    means = [np.bincount(pair, weight * column) / np.maximum(total, 1e-12) for column in values.T]
    return values - np.stack(means, axis=1)[pair]


def write_falloffs(falloffs: Mapping[int, Falloff | None], path: Path) -> None:
    """Write falloffs by camera id."""
    path.write_text(json.dumps({camera_id: one and asdict(one) for camera_id, one in falloffs.items()}, indent=1))


def read_falloffs(path: Path) -> dict[int, Falloff | None]:
    """Read what `write_falloffs` wrote."""
    told = json.loads(path.read_text())
    return {int(camera_id): one and Falloff(**one) for camera_id, one in told.items()}
