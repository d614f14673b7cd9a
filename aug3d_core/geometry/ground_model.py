"""The ground as a surface z(x, y), fitted to the points of a scene: level, tilted, or a smooth height field.

What stands on the ground hides it: roofs and crowns lie above, and a few false points below. Two steps see to both. The
points are thinned to one low height per square cell. The surface is then fitted again and again with weights that fall
with the distance to the last fit, as airborne laser scans are filtered (Kraus and Pfeifer, "Determination of terrain
models in wooded areas with airborne laser scanner data", ISPRS Journal 53, 1998); the scale of the weights comes from
the cells under the surface, where no roof is. The smooth surface is a penalised spline (Eilers and Marx, "Flexible
smoothing with B-splines and penalties", Statistical Science 11, 1996).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.interpolate import NdBSpline

from aug3d_core.geometry.ground_surface import GroundModel, Kind, knots
from aug3d_core.geometry.robust import spread
from aug3d_core.run.errors import InputError

_CELLS = 900
_POINTS_PER_CELL = 8  # wanted, where points are few
_LEAST_POINTS = 3
_LOW_PERCENTILE = 10.0
_FEWEST_CELLS = 8
_STRAY_PERCENT = 0.5  # of the points on each side are not trusted to say how far the scene reaches
_SPANS = (3, 5)  # of the smooth surface along the longer side; finer ones would climb onto large buildings
_PENALTY = 3e-4
_LEAST_GAIN = 5e-4  # of the extent: a mean gain below it is not worth a less simple kind
_FOLDS = 5
_PATCH = 3  # cells along a side that are held out together: what stands on the ground covers several
_ROUNDS = 30
_SIDED_ROUNDS = 10
_ABOVE_WEIGHT = 0.25  # finds the lowest fifth
_ANNEAL = 4.0  # how much wider the weights are at first
_FINEST = 1e-3  # of the extent: heights that differ by less are the same
_ROUGHEST = 0.06  # of the extent: a surface that misses its own cells by more is none
_MOST_BELOW = 0.25


def fit_ground(points_in_world: Float[np.ndarray, "p 3"], rng: np.random.Generator) -> GroundModel:
    """Return the simplest surface that foretells held-out ground as well as any, within one standard error.

    Raises InputError where no surface of z(x, y) lies under the points: too few of them, or an upright thing alone.
    """
    cells, extent = _low_cells(points_in_world)
    if len(cells) < _FEWEST_CELLS:
        raise _no_ground(f"{len(points_in_world)} points lie in {len(cells)} places of the ground plane")
    box = np.stack([cells[:, :2].min(axis=0), cells[:, :2].max(axis=0)])
    forms = [_Form("level", box), _Form("tilted", box), *(_Form("smooth", box, spans) for spans in _SPANS)]
    finest = _FINEST * extent
    fold = _folds(cells[:, :2], extent, rng)
    residuals = np.stack([_held_out(form, cells, fold, finest) for form in forms])
    scales = [max(finest, _scale(residual)) for residual in residuals]
    losses = np.minimum(np.abs(residuals), 3 * min(scales))
    best = int(losses.mean(axis=1).argmin())
    more = losses - losses[best]
    standard_error = more.std(axis=1) / np.sqrt(len(cells))
    least_gain = [_LEAST_GAIN * extent if form.kind != forms[best].kind else 0.0 for form in forms]
    chosen = int(np.argmax(more.mean(axis=1) <= np.maximum(standard_error, least_gain)))
    coefficients = _fit(forms[chosen].design(cells[:, :2]), cells[:, 2], forms[chosen].penalty, finest)
    model = forms[chosen].model(coefficients, float(scales[chosen]))
    _check(model, points_in_world, extent)
    return model


@dataclass(frozen=True)
class _Form:
    """A family of surfaces that are linear in their coefficients: 1, 3 or 3 + those of a spline."""

    kind: Kind
    box: Float[np.ndarray, "2 2"]
    spans: int = 0

    def design(self, xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n c"]:
        """Return what each coefficient adds to the height at places."""
        columns = [np.ones((len(xy), 1))]
        if self.kind != "level":
            columns.append((xy - self.box.mean(axis=0)) / self._side)
        if self.kind == "smooth":
            spline = NdBSpline.design_matrix(xy.clip(*self.box), knots(self.box, self._shape), 3)
            spline.resize(len(xy), np.prod(self._shape))  # it leaves out the last columns where they are empty
            columns.append(spline.toarray())
        return np.hstack(columns)

    @property
    def penalty(self) -> Float[np.ndarray, "r c"]:
        """Return rows whose squares are added to the squared residuals: second differences of the spline, and a little
        of its coefficients, so that the plane carries what a plane can.
        """
        if self.kind != "smooth":
            return np.zeros((0, 1 if self.kind == "level" else 3))
        places = np.arange(np.prod(self._shape)).reshape(self._shape)
        eye = np.eye(places.size)
        bends = [
            np.diff(eye[places], n=2, axis=axis).reshape(-1, places.size) for axis in (0, 1) if self._shape[axis] > 2
        ]
        rows = np.concatenate([*bends, 0.1 * eye]) * np.sqrt(_PENALTY)
        return np.hstack([np.zeros((len(rows), 3)), rows])

    def model(self, coefficients: Float[np.ndarray, " c"], error: float) -> GroundModel:
        """Return the surface with these coefficients."""
        slope = coefficients[1:3] / self._side if self.kind != "level" else np.zeros(2)
        plane = np.append(slope, coefficients[0] - slope @ self.box.mean(axis=0))
        bumps = coefficients[3:].reshape(self._shape) if self.kind == "smooth" else None
        return GroundModel(self.kind, plane, bumps, self.box, error)

    @property
    def _side(self) -> float:
        return float((self.box[1] - self.box[0]).max())

    @property
    def _shape(self) -> tuple[int, int]:
        across = (self.box[1] - self.box[0]) / self._side
        x, y = np.maximum(1, np.rint(self.spans * across)).astype(int) + 3
        return int(x), int(y)


def _low_cells(points: Float[np.ndarray, "p 3"]) -> tuple[Float[np.ndarray, "c 3"], float]:
    """Return a low point of each square cell, and the longer side of the scene."""
    if len(points) < _LEAST_POINTS:
        return np.zeros((0, 3)), 0.0
    west_south, east_north = np.percentile(points[:, :2], [_STRAY_PERCENT, 100 - _STRAY_PERCENT], axis=0)
    size = np.maximum(east_north - west_south, 1e-9)
    points = points[((points[:, :2] >= west_south) & (points[:, :2] <= east_north)).all(axis=1)]
    count = np.clip(len(points) / _POINTS_PER_CELL, _FEWEST_CELLS, _CELLS)
    side = max(float(np.sqrt(size.prod() / count)), float(size.max()) / _CELLS)
    place = np.floor((points[:, :2] - west_south) / side).astype(np.int64)
    _, cell, inside = np.unique(place @ [1, 1 << 20], return_inverse=True, return_counts=True)
    order = np.lexsort((points[:, 2], cell))
    first = np.cumsum(inside) - inside
    low = order[first + np.floor((inside - 1) * _LOW_PERCENTILE / 100).astype(int)]
    return points[low[inside >= _LEAST_POINTS]], float(size.max())


def _fit(
    design: Float[np.ndarray, "n c"], height: Float[np.ndarray, " n"], penalty: Float[np.ndarray, "r c"], finest: float
) -> Float[np.ndarray, " c"]:
    """Return the coefficients of the lower surface: rounds that pull down, then rounds that drop what is far from it."""
    rows, zeros = penalty * np.sqrt(len(height)), np.zeros(len(penalty))
    weight = np.ones(len(height))
    coefficients = np.zeros(design.shape[1])
    for turn in range(_ROUNDS):
        left = np.concatenate([design * np.sqrt(weight)[:, None], rows])
        coefficients = np.linalg.lstsq(left, np.concatenate([height * np.sqrt(weight), zeros]), rcond=None)[0]
        residual = height - design @ coefficients
        if turn < _SIDED_ROUNDS:
            weight = np.where(residual > 0, _ABOVE_WEIGHT, 1.0) / np.maximum(finest, np.abs(residual))
        else:
            reach = 2 * _ANNEAL ** max(0.0, 1 - (turn - _SIDED_ROUNDS) / _SIDED_ROUNDS)
            weight = 1 / (1 + (residual / (reach * max(finest, _scale(residual)))) ** 4)
    return coefficients


def _scale(residual: Float[np.ndarray, " n"]) -> float:
    """Return a robust deviation: from the residuals below the surface, where no roof is, or from all, the smaller."""
    below = -residual[residual <= 0]
    return min(spread(part) if len(part) else 0.0 for part in (below, residual))


def _held_out(
    form: _Form, cells: Float[np.ndarray, "c 3"], fold: Int[np.ndarray, " c"], finest: float
) -> Float[np.ndarray, " c"]:
    """Return how far each cell lies above the surface that was fitted without it and its neighbours."""
    design, residual = form.design(cells[:, :2]), np.zeros(len(cells))
    for number in range(_FOLDS):
        out = fold == number
        fitted = _fit(design[~out], cells[~out, 2], form.penalty, finest)
        residual[out] = cells[out, 2] - design[out] @ fitted
    return residual


def _folds(xy: Float[np.ndarray, "c 2"], extent: float, rng: np.random.Generator) -> Int[np.ndarray, " c"]:
    patch = np.floor(xy / (_PATCH * extent / np.sqrt(_CELLS))).astype(np.int64)
    number = np.unique(patch @ [1, 1 << 20], return_inverse=True)[1]
    return (rng.permutation(number.max() + 1) % _FOLDS)[number]


def _check(model: GroundModel, points: Float[np.ndarray, "p 3"], extent: float) -> None:
    if model.error > _ROUGHEST * extent:
        raise _no_ground(f"the lowest points miss any smooth surface by {model.error / extent:.0%} of the scene's side")
    above = points[:, 2] - model.height_at(points[:, :2])
    below = float((above < -max(3 * model.error, 10 * _FINEST * extent)).mean())
    if below > _MOST_BELOW:
        raise _no_ground(f"{below:.0%} of the points lie under the surface that would be the ground")


def _no_ground(why: str) -> InputError:
    return InputError(f"no ground is to be found in the points: {why}", "Choose a method that needs no ground.")
