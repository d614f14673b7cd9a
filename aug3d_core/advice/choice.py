"""The photographs that make up for most of what is missing, one after another.

What is missing falls less and less with each photograph of a place, so that taking the best one each time is within 1 - 1/e of
the best set (Nemhauser, Wolsey and Fisher 1978), and a candidate's gain never grows: only those that may still be best are
asked again (Minoux 1978).
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aug3d_core.advice.need import POOR, Look, Need, look_of
from aug3d_core.advice.site import Site
from aug3d_core.geometry.transforms import forward
from aug3d_core.geometry.views import Views

_APART = 4  # candidates along a picture
_MOST_PLACES = 1200
_BEYOND = 0.75  # pictures: so far outside the area a tilted camera may stand, to look into it
_MOST_TILT_DEG = 45.0


@dataclass(frozen=True)
class Advised:
    """A photograph to take. rank: from 1, by what it adds. adds: share of what was missing before all of them.

    poor: share of what it shows of which more than POOR is missing. hole: share that the mesh has nothing of. error: of the
    model where it looks, 1 as usual elsewhere. yaw_deg: clockwise from north (+y), of the upper edge of the picture. pitch_deg:
    of the gimbal, -90 straight down.
    """

    rank: int
    xyz: tuple[float, float, float]
    yaw_deg: float
    pitch_deg: float
    adds: float
    poor: float
    hole: float
    error: float


@dataclass(frozen=True)
class Choice:
    """advised: in order of rank. missing: share of the site before any of them and after each, one more than advised."""

    advised: tuple[Advised, ...]
    missing: tuple[float, ...]


def candidates(site: Site, views: Views) -> tuple[Float[np.ndarray, "c 3"], Float[np.ndarray, "c 2"]]:
    """Return where cameras may stand, and their yaw and pitch [degrees]: tilted and turned as the flight was."""
    tilt, yaws = usual_look(views)
    wanted = site.area.middle(site.area.wanted)
    low, high = wanted.min(axis=0), wanted.max(axis=0)
    beyond = _BEYOND * site.picture
    step = max(site.picture / _APART, float(np.sqrt(np.prod(high - low + 2 * beyond) / _MOST_PLACES)))
    grid = np.stack(np.meshgrid(*(np.arange(a - beyond, b + beyond, step) for a, b in zip(low, high, strict=True))), -1)
    grid = grid.reshape(-1, 2)
    stand, turn = [], []
    for yaw in yaws:
        ahead = np.array([np.sin(np.radians(yaw)), np.cos(np.radians(yaw))])
        aims = site.area.has(grid + ahead * site.height * np.tan(np.radians(tilt)))
        stand.append(site.flown(grid[aims]))
        turn.append(np.tile([yaw, tilt - 90.0], (int(aims.sum()), 1)))
    return np.concatenate(stand), np.concatenate(turn)


def usual_look(views: Views) -> tuple[float, tuple[float, float]]:
    """Return the tilt from straight down, and the yaws of a camera there and back along the flight's lines [degrees].

    The axis is the mean of doubled angles: lines that are flown both ways have one.
    """
    down = np.degrees(np.arccos(np.clip(-forward(views.cam_from_world)[:, 2], -1, 1)))
    east, north = -views.cam_from_world[:, 1, :2].T  # of the upper edge
    axis = float(np.degrees(np.angle(np.exp(2j * np.arctan2(east, north)).mean())) / 2) % 180
    return min(float(np.median(down)), _MOST_TILT_DEG), (axis, axis + 180)


def pose(xyz: Float[np.ndarray, " 3"], yaw_deg: float, pitch_deg: float) -> Float[np.ndarray, "3 4"]:
    """Return the `cam_from_world` of a camera without roll, the upper edge of its picture towards yaw."""
    yaw, pitch = np.radians([yaw_deg, pitch_deg])
    z = np.array([np.sin(yaw) * np.cos(pitch), np.cos(yaw) * np.cos(pitch), np.sin(pitch)])
    x = np.array([np.cos(yaw), -np.sin(yaw), 0.0])
    rotation = np.stack([x, np.cross(z, x), z])
    return np.concatenate([rotation, (-rotation @ xyz)[:, None]], axis=1)


def chosen(
    site: Site,
    views: Views,
    need: Need,
    error: Float[np.ndarray, " s"],
    count: int,
    progress: Callable[[int, int], None],
) -> Choice:
    """Return so many photographs to take, fewer where none adds anything. `need` counts them afterwards."""
    intrinsics, size = np.median(views.intrinsics, axis=0), np.median(views.size, axis=0).astype(int)
    stand, turn = candidates(site, views)
    looks: list[Look] = []
    for done, (xyz, (yaw, pitch)) in enumerate(zip(stand, turn, strict=True)):
        looks.append(look_of(site, pose(xyz, yaw, pitch), intrinsics, size))
        progress(done + 1, len(stand))
    heap = [(-float(need.added(look).sum()), candidate) for candidate, look in enumerate(looks)]
    heapq.heapify(heap)
    missing, advised, left = [need.missing], [], need.missing_at()
    while heap and len(advised) < count:
        _, best = heapq.heappop(heap)
        gain = need.added(looks[best])
        if heap and gain.sum() < -heap[0][0]:
            heapq.heappush(heap, (-float(gain.sum()), best))
            continue
        if gain.sum() <= 0:
            break
        advised.append(
            _advised(len(advised) + 1, stand[best], turn[best], looks[best], site, left, error, gain, missing[0])
        )
        need.take(looks[best])
        left = need.missing_at()
        missing.append(need.missing)
    return Choice(tuple(advised), tuple(missing))


def _advised(
    rank: int,
    xyz: Float[np.ndarray, " 3"],
    turn: Float[np.ndarray, " 2"],
    look: Look,
    site: Site,
    left: Float[np.ndarray, " s"],
    error: Float[np.ndarray, " s"],
    gain: Float[np.ndarray, " k"],
    before: float,
) -> Advised:
    east, north, up = (float(value) for value in xyz)
    return Advised(
        rank=rank, xyz=(east, north, up), yaw_deg=float(turn[0]), pitch_deg=float(turn[1]),
        adds=float(gain.sum() / before), poor=float((left[look.sample] > POOR).mean()),
        hole=float(site.in_hole[look.sample].mean()),
        error=float((error[look.sample] * gain).sum() / gain.sum()),
    )  # fmt: skip
