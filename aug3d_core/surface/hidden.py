"""What a step hides: the foot of a wall, and the ground before it.

Beside a house or a tree lies ground that hardly any photograph sees, and a wall that they see aslant; both stay without points.
Poisson's surface goes down there in a ramp, from the eaves to the first ground that is seen, and seen from the other side the
ramp stands before what is there. What is missing is what is hidden, and that is the lower side: so its ground goes on up to the
step, and below the step's edge stands a wall. Ground that several photographs would see is not hidden: if it has no points it
has no texture, or is no ground, and the gap is left to Poisson.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int, Real
from scipy.ndimage import distance_transform_edt

from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Views
from aug3d_core.surface.colour import Spots
from aug3d_core.surface.evidence import Evidence

CELL_SPACINGS = 2.0  # width of a square of ground
MOST_CELLS = 4_000_000  # of a scene's ground: squares are wider where it would take more
# Cells: less is a slope between neighbours
LEAST_STEP = 2.0
# Height over width of a gap: photographs that look down hide ground behind a step under a line at least as steep
LEAST_RISE = 1.0
# Photographs that see a place whose depth nothing confirms
MOST_SEEING = 2
# Both ways along each of these lines the ends of a gap are looked for
_LINES = ((1, 0), (0, 1), (1, 1), (1, -1), (2, 1), (1, 2), (2, -1), (1, -2))
_BESIDE = ((1, 0), (-1, 0), (0, 1), (0, -1))


@dataclass(frozen=True)
class _Heights:
    """The highest and the lowest point over each square of ground; -inf and inf where there is none."""

    low: Float[np.ndarray, " 2"]  # corner of the first square
    cell: float
    top: Float[np.ndarray, "x y"]
    bottom: Float[np.ndarray, "x y"]

    @classmethod
    def of(cls, evidence: Evidence) -> _Heights:
        low, high = evidence.xyz[:, :2].min(axis=0), evidence.xyz[:, :2].max(axis=0)
        cell = max(CELL_SPACINGS * evidence.spacing, float(np.sqrt(np.prod(high - low) / MOST_CELLS)))
        place = np.floor((evidence.xyz[:, :2] - low) / cell).astype(np.int64)
        shape = tuple(place.max(axis=0) + 1)
        top, bottom = np.full(shape, -np.inf), np.full(shape, np.inf)
        np.maximum.at(top, tuple(place.T), evidence.xyz[:, 2])
        np.minimum.at(bottom, tuple(place.T), evidence.xyz[:, 2])
        return cls(low, cell, top, bottom)

    def middle(self, place: Real[np.ndarray, "n 2"], z: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 3"]:
        """Return points over the middles of squares; halves of a number are their edges."""
        return np.column_stack([self.low + (place + 0.5) * self.cell, z])


def with_hidden(evidence: Evidence, views: Views, chosen: Int[np.ndarray, " m"], max_gap: float) -> Evidence:
    """Return the points, and more of them where a step hides ground and wall in gaps of up to `max_gap` across.

    chosen: the views that the points are from. z points up.
    """
    heights = _Heights.of(evidence)
    place, z = _ground(heights, max_gap)
    if not len(place):
        return evidence
    hidden = _seeing(heights, heights.middle(place, z), views, chosen) <= MOST_SEEING
    place, z = place[hidden], z[hidden]
    wall, outwards = _walls(heights, place, z)
    up = np.tile([0.0, 0.0, 1.0], (len(place), 1))
    return replace(
        evidence,
        xyz=np.concatenate([evidence.xyz, heights.middle(place, z), wall]),
        normals=np.concatenate([evidence.normals, up, outwards]),
    )


def _ground(heights: _Heights, max_gap: float) -> tuple[Int[np.ndarray, "n 2"], Float[np.ndarray, " n"]]:
    """Return the squares of gaps that lie below a step, and the height of the step's foot: of the steepest that is found."""
    empty = np.isneginf(heights.top)
    squares_away = np.asarray(distance_transform_edt(empty))
    place = np.argwhere(empty & (squares_away * heights.cell <= max_gap / 2))
    foot, steepest = np.full(len(place), np.nan), np.full(len(place), LEAST_RISE)
    for line in _LINES:
        (one, near), (other, far) = (
            _first(heights, place, np.array(line) * way, max_gap / heights.cell) for way in (1, -1)
        )
        step, width = np.abs(one - other), (near + far - 1) * heights.cell
        rise = np.where(step > LEAST_STEP * heights.cell, step / width, 0)
        better = (rise > steepest) & (width <= max_gap)
        foot[better], steepest[better] = np.minimum(one, other)[better], rise[better]
    found = np.isfinite(foot)
    return place[found], foot[found]


def _at(values: Float[np.ndarray, "x y"], place: Int[np.ndarray, "n 2"], beyond: float) -> Float[np.ndarray, " n"]:
    """Return values of squares; `beyond` outside of all."""
    inside = ((place >= 0) & (place < values.shape)).all(axis=1)
    found = np.full(len(place), beyond)
    found[inside] = values[tuple(place[inside].T)]
    return found


def _first(
    heights: _Heights, place: Int[np.ndarray, "n 2"], way: Int[np.ndarray, " 2"], most: float
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return the height of the first square with points that lies this way, and how many squares away; NaN, inf if none."""
    height, distance = np.full(len(place), np.nan), np.full(len(place), np.inf)
    length = float(np.linalg.norm(way))
    still = np.arange(len(place))
    for count in range(1, int(most / length) + 1):
        top = _at(heights.top, place[still] + count * way, -np.inf)
        there = np.isfinite(top)
        height[still[there]], distance[still[there]] = top[there], count * length
        still = still[~there]
    return height, distance


def _seeing(
    heights: _Heights, xyz: Float[np.ndarray, "n 3"], views: Views, chosen: Int[np.ndarray, " m"]
) -> Int[np.ndarray, " n"]:
    """Count the views that frame each point and see it over all that has points; beyond MOST_SEEING it is not counted on."""
    seeing = np.zeros(len(xyz), np.int64)
    eyes, spots, highest = centres(views.cam_from_world), Spots(xyz), float(heights.top.max())
    for view in chosen:
        framed = spots.framed(views, int(view), 0.0).spot
        framed = framed[seeing[framed] <= MOST_SEEING]
        seeing[framed[_clear(heights, xyz[framed], eyes[view], highest)]] += 1
    return seeing


def _clear(
    heights: _Heights, xyz: Float[np.ndarray, "n 3"], eye: Float[np.ndarray, " 3"], highest: float
) -> Bool[np.ndarray, " n"]:
    """Tell from which points the line to a camera passes over all that has points."""
    towards = eye - xyz
    away = np.linalg.norm(towards[:, :2], axis=1)
    towards = towards / np.maximum(away, 1e-9)[:, None] * heights.cell
    clear, still = np.ones(len(xyz), bool), np.arange(len(xyz))
    count = 0
    while len(still):
        count += 1
        at = xyz[still] + count * towards[still]
        going = (at[:, 2] < highest) & (count * heights.cell < away[still])
        still, at = still[going], at[going]
        square = np.floor((at[:, :2] - heights.low) / heights.cell).astype(np.int64)
        behind = _at(heights.top, square, -np.inf) > at[:, 2]
        clear[still[behind]] = False
        still = still[~behind]
    return clear


def _walls(
    heights: _Heights, place: Int[np.ndarray, "n 2"], z: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, "w 3"], Float[np.ndarray, "w 3"]]:
    """Return points, and their normals, between hidden ground and the lowest points over the squares beside it."""
    points, normals = [], []
    for beside in _BESIDE:
        rise = _at(heights.bottom, place + beside, np.inf) - z
        stands = np.isfinite(rise) & (rise > LEAST_STEP * heights.cell)
        count = np.where(stands, rise / heights.cell, 0).astype(np.int64)
        row = np.repeat(np.arange(len(place)), count)
        level = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
        points.append(heights.middle(place[row] + 0.5 * np.array(beside), z[row] + (level + 0.5) * heights.cell))
        normals.append(np.tile([-beside[0], -beside[1], 0.0], (len(row), 1)))
    return np.concatenate(points), np.concatenate(normals)
