"""What part of the surface each view sees, without a mesh: a coarse net of rays on a raster of heights.

The raster holds the upper height of the points in each square of ground, and the fitted ground where there are none (the
lowest points where there is no ground). Where a ray of a view first goes under it, the view sees the cube of space that
holds that place; opposite walls of a tower so are different cubes, and how much texture a wall has does not matter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import sparse

from aug3d_core.geometry.ground_model import GroundModel
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Views

_NET = (16, 12)  # rays across and down a picture
_CUBE_OVER_SPACING = 1.5  # side of a cube over the median distance between neighbouring rays where they end
_POINTS_PER_SQUARE = 4
_MOST_SQUARES = 1_000_000
_UPPER = 0.8  # quantile of the heights in a square: walls stand over the ground beside them
_TRUSTED_PERCENT = (0.2, 99.8)  # of heights and places: points beyond are strays
_STEPS, _HALVINGS = 48, 5  # at most: a step need be no shorter than a square
_VIEWS_AT_ONCE = 256


@dataclass(frozen=True)
class _Raster:
    """Heights (x, y) of squares with this side from a south-west corner, in world units."""

    height: Float[np.ndarray, "x y"]
    corner: Float[np.ndarray, " 2"]
    side: float

    def at(self, xy: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, " *n"]:
        """Return the height at places, -inf beyond the raster."""
        place = np.floor((xy - self.corner) / self.side).astype(np.int64)
        inside = ((place >= 0) & (place < self.height.shape)).all(axis=-1)
        x, y = np.where(inside[..., None], place, 0).transpose(-1, *range(place.ndim - 1))
        return np.where(inside, self.height[x, y], -np.inf)


def seen_cells(views: Views, points_in_world: Float[np.ndarray, "p 3"], ground: GroundModel | None) -> sparse.csr_array:
    """Return F (views x cubes): the square root of the number of a view's rays that end in a cube.

    Scaled to ones on its diagonal, F F^T is Bhattacharyya's coefficient of two views: with p and q the shares of their
    pictures that show a cube, the sum of sqrt(p q) over all cubes; 1 where they show the same, 0 where nothing is common.
    """
    if not len(points_in_world):
        return sparse.csr_array((len(views), 0))
    raster = _raster(points_in_world, ground)
    parts = np.array_split(np.arange(len(views)), -(-len(views) // _VIEWS_AT_ONCE))
    found = [_seen(views.take(part), raster) for part in parts]
    view = np.concatenate([part[seen[0]] for part, seen in zip(parts, found, strict=True)])
    place = np.concatenate([seen[1] for seen in found])
    spacing = np.concatenate([seen[2] for seen in found])
    cube = np.floor(place / (_CUBE_OVER_SPACING * np.median(spacing))).astype(np.int64) if len(place) else place
    cell = np.unique(cube, axis=0, return_inverse=True)[1].ravel()
    seen = sparse.coo_array((np.ones(len(view)), (view, cell)), shape=(len(views), cell.max(initial=-1) + 1))
    matrix = seen.tocsr()
    matrix.sum_duplicates()
    matrix.data = np.sqrt(matrix.data)
    return matrix


def _seen(
    views: Views, raster: _Raster
) -> tuple[Int[np.ndarray, " h"], Float[np.ndarray, "h 3"], Float[np.ndarray, " h"]]:
    """Return the rays that end on the surface: their view, where they end, and how far apart neighbours end there."""
    net = np.stack(np.meshgrid(*((np.arange(n) + 0.5) / n for n in _NET)), axis=-1).reshape(-1, 2)
    in_cam = (net * views.size[:, None] - views.intrinsics[:, None, 2:]) / views.intrinsics[:, None, :2]
    in_cam = np.concatenate([in_cam, np.ones((*in_cam.shape[:2], 1))], axis=2)
    directions = (in_cam @ views.cam_from_world[:, :, :3]).reshape(-1, 3)
    eyes = np.repeat(centres(views.cam_from_world), len(net), axis=0)
    depth = _first_hit(eyes, directions, raster)
    hit = np.isfinite(depth)
    view = np.repeat(np.arange(len(views)), len(net))[hit]
    spacing = depth[hit] * views.size[view, 0] / views.intrinsics[view, 0] / _NET[0]
    return view, eyes[hit] + depth[hit, None] * directions[hit], spacing


def _first_hit(eyes: np.ndarray, directions: np.ndarray, raster: _Raster) -> Float[np.ndarray, " r"]:
    """Return how far along each ray it first goes under the raster, inf where it does not; rays must sink."""
    low, high = raster.height.min(), raster.height.max()
    sinks = directions[:, 2] < -1e-9
    fall = np.where(sinks, -directions[:, 2], 1.0)
    near = np.maximum(0.0, (eyes[:, 2] - high) / fall)
    far = np.minimum((eyes[:, 2] - low) / fall * (1 + 1e-9), _leaves(eyes, directions, raster))
    across = np.linalg.norm(directions[:, :2], axis=1) * (far - near)
    steps = np.where(sinks & (far > near), np.ceil(across / raster.side).clip(1, _STEPS), 0)
    step = (far - near) / np.maximum(steps, 1)
    over, hit = near.copy(), np.zeros(len(near), bool)
    for turn in range(int(steps.max(initial=0))):
        rays = np.flatnonzero(~hit & (turn < steps))
        under = _under(eyes[rays], directions[rays], over[rays] + step[rays], raster)
        hit[rays[under]] = True
        over[rays[~under]] += step[rays[~under]]
    for _ in range(_HALVINGS):
        step = step / 2
        rays = np.flatnonzero(hit)
        under = _under(eyes[rays], directions[rays], over[rays] + step[rays], raster)
        over[rays[~under]] += step[rays[~under]]
    return np.where(hit, over + step, np.inf)


def _under(eyes: np.ndarray, directions: np.ndarray, distance: np.ndarray, raster: _Raster) -> Bool[np.ndarray, " r"]:
    at = eyes + distance[:, None] * directions
    return at[:, 2] <= raster.at(at[:, :2])


def _leaves(eyes: np.ndarray, directions: np.ndarray, raster: _Raster) -> Float[np.ndarray, " r"]:
    """Return where rays leave the raster sideways for good."""
    end = raster.corner + np.array(raster.height.shape) * raster.side
    along = np.where(np.abs(directions[:, :2]) < 1e-12, 1e-12, directions[:, :2])
    return ((np.where(along > 0, end, raster.corner) - eyes[:, :2]) / along).min(axis=1)


def _raster(points: Float[np.ndarray, "p 3"], ground: GroundModel | None) -> _Raster:
    low, high = np.percentile(points, _TRUSTED_PERCENT, axis=0)
    points = points[((points >= low) & (points <= high)).all(axis=1)]
    size = np.maximum((high - low)[:2], 1e-9)
    squares = np.clip(len(points) / _POINTS_PER_SQUARE, 1, _MOST_SQUARES)
    side = max(float(np.sqrt(size.prod() / squares)), float(size.max()) / _MOST_SQUARES**0.5)
    count = np.maximum(1, np.ceil(size / side)).astype(int)
    x, y = np.minimum((points[:, :2] - low[:2]) / side, count - 1).astype(int).T
    number = x * count[1] + y
    order = np.lexsort((points[:, 2], number))
    held, first, inside = np.unique(number[order], return_index=True, return_counts=True)
    height = _bare(ground, low, side, count).ravel()
    height[held] = points[order[first + np.floor((inside - 1) * _UPPER).astype(int)], 2]
    return _Raster(height.reshape(count), low[:2], side)


def _bare(ground: GroundModel | None, low: np.ndarray, side: float, count: np.ndarray) -> Float[np.ndarray, "x y"]:
    if ground is None:  # an upright thing alone: nothing hides what is beside it
        return np.full(tuple(count), low[2])
    return ground.height_at((np.moveaxis(np.indices(tuple(count)), 0, -1) + 0.5) * side + low[:2])
