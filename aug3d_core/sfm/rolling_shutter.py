"""Measure a rolling shutter: how far the camera flew on while its sensor was read row by row.

A row sees from `centre + velocity * read-out * (y - cy) / height`, y counted downward: the model of Vautherin et al. 2016,
"Photogrammetric accuracy and modeling of rolling shutter cameras", with one read-out for all photographs, and velocities from
their neighbours in capture order. Adjustment knew nothing of it. Here it is one unknown more beside poses, points and lens, in
the linear system about what adjustment ended at: what these can explain is taken from it, and from what adjustment left over,
and the read-out is what fits the rest. Straight down over flat ground, flown one way and back, the rest is next to nothing, for
a world that is stretched along the flight makes the same pictures; then the interval is wide, and the word is that it cannot be
told. Crossing lines, or tilted cameras that look several ways, tell it.

Poses are not corrected. Plain numpy and scipy. Shapes: n views, t observations, p points, s = 2 t their coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int
from scipy import sparse
from scipy.stats import t as student

from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.run.stage import Metric

# Cameras of seven made-up flights were off by 0.6 to 1.7 pixels of the ground without it, by 0.8 to 1.8 at 1 px, by 1 to 3 at
# 2 px, by 2 to 14 at 4 px (medians of four seeds; the flights of `tests/sfm/test_rolling_shutter.py`)
MOST_PX = 1.0

# Flight is straight and even at a photograph if the steps before and after it turn and differ in length by no more, and the
# places of up to `_REACH` neighbours on each side leave a line by no more of a step. A line through many of them: the wobble of
# single places is no velocity, and made the answer too small by a half where it is all that tells.
_MOST_TURN_DEG, _MOST_RATIO, _REACH, _MOST_OFF = 20.0, 1.5, 3, 0.15
_FEWEST_VIEWS = 10  # of 8, one flight of 12 without a rolling shutter was given one; of 12, none of 150
_MOST_VIEWS, _MOST_OBSERVATIONS = 150, 15_000
_WRONG = 10.0  # times the median residual: wrong matches, whose row is not known either
_ROUNDS = 5
_EXACT_PX = 1e-3  # residuals below are none
_CHANCE = 0.01
# What the interval holds beside noise. Of the picture's width: what no model of a lens fits, which looked like a movement of
# up to 2.4e-5 where nothing moved (towns, brighton). Of the answer: the system is linear, and velocities are rough
_LENS_SHARE, _ROUGH = 3e-5, 0.1
_GAUGE = 1e-9  # relative; the frame of the world is free


@dataclass(frozen=True)
class RollingShutter:
    """How far the ground moves in a photograph from its first row to its last: the median of what was seen.

    Below zero, rows are read from the last to the first. low_px, high_px: its 99 % interval. readout_s: in how long all rows
    are read; None without times of capture, or where the interval holds zero.
    """

    px: float
    low_px: float
    high_px: float
    readout_s: float | None

    @property
    def word(self) -> Literal["seen", "not seen", "cannot be told"]:
        """Whether it is more than `MOST_PX`, less, or either may be."""
        if max(self.low_px, -self.high_px) > MOST_PX:
            return "seen"
        return "not seen" if max(self.high_px, -self.low_px) < MOST_PX else "cannot be told"


def measure_rolling_shutter(
    views: Views, points: Points, tracks: Tracks, photos: pd.DataFrame
) -> RollingShutter | None:
    """Measure it after adjustment; None where too few photographs were taken in straight and even flight.

    photos: the table of all photographs; row i has `height_px` of the working copy, and `time`, of photo i.
    """
    velocity = _velocities(centres(views.cam_from_world), views.photo_id)
    used = _used(views, velocity)
    if used.sum() < _FEWEST_VIEWS:
        return None
    good = _fit_to_use(views, points, tracks, used)
    if len(np.unique(tracks.view[good])) < _FEWEST_VIEWS:
        return None
    kept = Tracks(tracks.point[good], tracks.view[good], tracks.xy[good])
    seen = _linearised(views, points, kept, velocity, photos["height_px"].to_numpy(float)[views.photo_id])
    fit = _fit(seen)
    lens_px = _LENS_SHARE * float(np.median(views.size[used, 0]))
    half = float(student.ppf(1 - _CHANCE / 2, used.sum() - 1)) * fit.sigma + lens_px / fit.told_px
    half += _ROUGH * abs(fit.share)
    low, high = fit.share - half, fit.share + half
    shot_s = _seconds_per_shot(photos, views.photo_id[used])
    flow_px = float(np.median(np.linalg.norm(seen.flow_px, axis=1)))
    readout_s = abs(fit.share) * shot_s if shot_s is not None and low * high > 0 else None
    return RollingShutter(flow_px * fit.share, flow_px * low, flow_px * high, readout_s)


def shutter_metrics(shutter: RollingShutter | None) -> dict[str, Metric]:
    """Return its figures, all of them None but the word where nothing was measured."""
    return {
        "rolling_shutter": shutter.word if shutter else "cannot be told",
        "rolling_shutter_px": shutter and shutter.px,
        "rolling_shutter_low_px": shutter and shutter.low_px,
        "rolling_shutter_high_px": shutter and shutter.high_px,
        "readout_ms": 1000 * shutter.readout_s if shutter and shutter.readout_s is not None else None,
    }


def shutter_notes(shutter: RollingShutter | None) -> tuple[str, ...]:
    """Say in words what it costs and what to do; nothing, unless it is surely too much."""
    if shutter is None or shutter.word != "seen":
        return ()
    px, (least, most) = abs(shutter.px), sorted((abs(shutter.low_px), abs(shutter.high_px)))
    read = f", read in {1000 * shutter.readout_s:.0f} ms" if shutter.readout_s else ""
    slower = int(np.ceil(px / MOST_PX))
    return (
        f"rolling shutter: the camera flies on while it reads a photograph{read}, by {px:.1f} px ({least:.1f} to {most:.1f}) "
        f"from the first row to the last: cameras are off by as much of the ground or more; fly at 1/{slower} of "
        "the speed, stop for each photograph, or use a camera with a mechanical shutter",
    )


@dataclass(frozen=True)
class _Seen:
    """Observations, and how each moves, in px, by what: its view's pose, its lens, its point; and the read-out of a whole step.

    flow_px: over all rows. row: of these, counted from the middle. Views, lenses and points are numbered from 0.
    """

    view: Int[np.ndarray, " t"]
    lens: Int[np.ndarray, " t"]
    point: Int[np.ndarray, " t"]
    residual_px: Float[np.ndarray, "t 2"]
    by_pose: Float[np.ndarray, "t 2 6"]
    by_lens: Float[np.ndarray, "t 2 7"]
    by_point: Float[np.ndarray, "t 2 3"]
    flow_px: Float[np.ndarray, "t 2"]
    row: Float[np.ndarray, " t"]


@dataclass(frozen=True)
class _Fit:
    """Read-out as a share of the time between photographs, and its standard error.

    told_px: what a whole step moves observations by that nothing else explains, its root mean square.
    """

    share: float
    sigma: float
    told_px: float


def _velocities(at: Float[np.ndarray, "n 3"], photo_id: Int[np.ndarray, " n"]) -> Float[np.ndarray, "n 3"]:
    """Return how far each camera flies from one photograph to the next, NaN where its flight is not straight and even."""
    velocity = np.full(at.shape, np.nan)
    straight = _straight(at, photo_id)
    for i in np.flatnonzero(straight):
        first, last = i - 1, i + 1
        while i - first < _REACH and straight[first]:
            first -= 1
        while last - i < _REACH and straight[last]:
            last += 1
        near, shot = at[first : last + 1], np.arange(first, last + 1) - (first + last) / 2
        slope = shot @ near / (shot @ shot)
        off = near - near.mean(axis=0) - shot[:, None] * slope
        if np.sqrt((off**2).sum(axis=1).mean()) <= _MOST_OFF * np.linalg.norm(slope):
            velocity[i] = slope
    return velocity


def _straight(at: Float[np.ndarray, "n 3"], photo_id: Int[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Tell where the step before and the step after are alike; never at the ends."""
    step = np.diff(at, axis=0)
    length = np.linalg.norm(step, axis=1)
    next_to = np.diff(photo_id) == 1
    before, after = length[:-1], length[1:]
    alike = np.maximum(before, after) <= _MOST_RATIO * np.minimum(before, after)
    ahead = (step[:-1] * step[1:]).sum(axis=1) > np.cos(np.radians(_MOST_TURN_DEG)) * before * after
    return np.concatenate([[False], next_to[:-1] & next_to[1:] & alike & ahead, [False]])[: len(at)]


def _used(views: Views, velocity: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
    """Tell which views have a velocity; of many, those about the middle, where lines of all directions meet."""
    known = np.isfinite(velocity[:, 0])
    if known.sum() <= _MOST_VIEWS:
        return known
    at = centres(views.cam_from_world)
    off = np.where(known, np.linalg.norm(at - np.median(at[known], axis=0), axis=1), np.inf)
    return off <= np.sort(off)[_MOST_VIEWS - 1]


def _seconds_per_shot(photos: pd.DataFrame, used: Int[np.ndarray, " n"]) -> float | None:
    """Return the mean time from one photograph to the next; a mean, since many cameras write whole seconds."""
    time = photos["time"].to_numpy()
    seconds = (time[used + 1] - time[used - 1]) / np.timedelta64(2, "s")
    return float(seconds.mean()) if np.isfinite(seconds).all() and seconds.mean() > 0 else None


def _in_cam(views: Views, points: Points, tracks: Tracks) -> Float[np.ndarray, "t 3"]:
    pose = views.cam_from_world[tracks.view]
    return np.einsum("tij,tj->ti", pose[:, :, :3], points.xyz[tracks.point]) + pose[:, :, 3]


def _fit_to_use(views: Views, points: Points, tracks: Tracks, used: Bool[np.ndarray, " n"]) -> Bool[np.ndarray, " t"]:
    """Tell which observations are of points that at least three used views see; of many, of a part of the points."""
    xyz, (fx, fy, cx, cy) = _in_cam(views, points, tracks), views.intrinsics[tracks.view].T
    good = used[tracks.view] & (xyz[:, 2] > 0)
    x, y = (xyz[:, :2] / np.where(good, xyz[:, 2], 1.0)[:, None]).T
    off_px = np.linalg.norm(tracks.xy - np.column_stack([fx * x + cx, fy * y + cy]), axis=1)
    good &= off_px <= _WRONG * max(float(np.median(off_px[good])), _EXACT_PX) if good.any() else good
    good &= np.bincount(tracks.point[good], minlength=len(points.xyz))[tracks.point] >= 3
    several = np.unique(tracks.point[good])
    return good & np.isin(tracks.point, several[:: 1 + good.sum() // _MOST_OBSERVATIONS])


def _linearised(
    views: Views,
    points: Points,
    tracks: Tracks,
    velocity: Float[np.ndarray, "n 3"],
    height_px: Float[np.ndarray, " n"],
) -> _Seen:
    """Return the observations with how they move. height_px: over which rows are read."""
    view, xyz = tracks.view, _in_cam(views, points, tracks)
    rotation, (fx, fy, cx, cy) = views.cam_from_world[view, :, :3], views.intrinsics[view].T
    x, y, depth = xyz[:, 0] / xyz[:, 2], xyz[:, 1] / xyz[:, 2], xyz[:, 2]
    by_xyz = np.zeros((len(view), 2, 3))
    by_xyz[:, 0, 0], by_xyz[:, 0, 2] = fx / depth, -fx * x / depth
    by_xyz[:, 1, 1], by_xyz[:, 1, 2] = fy / depth, -fy * y / depth
    by_turn = -np.cross(by_xyz, xyz[:, None])  # of a small turn w: xyz moves by w x xyz
    return _Seen(
        view=_numbered(view),
        lens=np.unique(views.intrinsics[view], axis=0, return_inverse=True)[1].ravel(),
        point=_numbered(tracks.point),
        residual_px=tracks.xy - np.column_stack([fx * x + cx, fy * y + cy]),
        by_pose=np.concatenate([by_turn, by_xyz], axis=2),
        by_lens=_by_lens(x, y) * np.stack([fx, fy], axis=1)[:, :, None],
        by_point=by_xyz @ rotation,
        flow_px=-np.einsum("tij,tjk,tk->ti", by_xyz, rotation, velocity[view]),
        # The row where the point should be: that where it was seen holds the noise of the residual
        row=fy * y / height_px[view],
    )


def _by_lens(x: Float[np.ndarray, " t"], y: Float[np.ndarray, " t"]) -> Float[np.ndarray, "t 2 7"]:
    """Return how rays (x, y, 1) move in focal lengths, by the terms of COLMAP's OPENCV with one focal length."""
    squared, one, none = x**2 + y**2, np.ones_like(x), np.zeros_like(x)
    of_x = [x, one, none, x * squared, x * squared**2, 2 * x * y, squared + 2 * x**2]
    of_y = [y, none, one, y * squared, y * squared**2, squared + 2 * y**2, 2 * x * y]
    return np.stack([np.column_stack(of_x), np.column_stack(of_y)], axis=1)


def _numbered(ids: Int[np.ndarray, " t"]) -> Int[np.ndarray, " t"]:
    return np.unique(ids, return_inverse=True)[1].ravel()


def _fit(seen: _Seen) -> _Fit:
    """Fit the read-out to what is left over, by Cauchy's weights; wrong matches weigh little, as in adjustment."""
    effect = (seen.flow_px * seen.row[:, None]).ravel()
    columns = np.column_stack([effect, seen.residual_px.ravel()])
    others, weight = _Others(seen), np.ones(len(columns))
    told, left, share = _fit_once(others, weight, columns)
    for _ in range(_ROUNDS):
        off_px = np.linalg.norm((left / weight).reshape(-1, 2), axis=1)
        weight = np.repeat(1 / np.hypot(1, off_px / max(2 * float(np.median(off_px)), _EXACT_PX)), 2)
        told, left, share = _fit_once(others, weight, columns)
    across = (seen.flow_px[:, ::-1] * [1, -1] * seen.row[:, None]).ravel()
    moved = others.cannot_explain(weight, np.hstack([_of_each(seen.view, effect), _of_each(seen.view, across)]))
    noise = float(left @ left) / max(1, len(left) - others.count)
    sigma = _standard_error(moved, left, noise)
    return _Fit(share, sigma, float(np.sqrt((told**2).sum() / (weight[::2] ** 2).sum())))


def _of_each(view: Int[np.ndarray, " t"], values: Float[np.ndarray, " s"]) -> Float[np.ndarray, "s n"]:
    """Return a column for each view, which holds its own values."""
    columns = np.zeros((len(values), view.max() + 1))
    columns[np.arange(len(values)), np.repeat(view, 2)] = values
    return columns


def _standard_error(moved: Float[np.ndarray, "s m"], left: Float[np.ndarray, " s"], noise: float) -> float:
    """Return that of the read-out where each photograph also moved by itself while it was read, as one that turned did.

    moved: what nothing else explains of a movement of each photograph along the flight; then, of each, across. noise: variance
    of a coordinate. How far photographs moved is by how much more than noise their sums of the former with what is left vary
    (DerSimonian, Laird 1986). Those sums alone were half of what they should be: poses and points follow each movement.
    """
    of_all = moved[:, : moved.shape[1] // 2].T @ moved
    shared = of_all[:, : len(of_all)]
    together, all_told = shared.sum(axis=1), float(shared.sum())
    apart = np.eye(len(shared)) - together[:, None] / all_told
    by_noise, by_moves = (float(np.trace(apart @ each @ apart.T)) for each in (shared, of_all @ of_all.T))
    sums = moved[:, : len(of_all)].T @ left
    variance = max(0.0, float(sums @ sums) - noise * by_noise) / by_moves
    return float(np.sqrt(variance * (of_all.sum(axis=0) ** 2).sum() / all_told**2 + noise / all_told))


def _fit_once(
    others: _Others, weight: Float[np.ndarray, " s"], columns: Float[np.ndarray, "s 2"]
) -> tuple[Float[np.ndarray, " s"], Float[np.ndarray, " s"], float]:
    """Return the effect that nothing else explains, what is left over, both weighted, and the read-out."""
    told, unexplained = others.cannot_explain(weight, columns).T
    share = float(told @ unexplained / (told @ told))
    return told, unexplained - share * told, share


class _Others:
    """Poses, lenses and points: the unknowns of adjustment, as the columns of two sparse matrices with a row per coordinate."""

    def __init__(self, seen: _Seen) -> None:
        views, lenses = seen.view.max() + 1, seen.lens.max() + 1
        by_pose = _columns(seen.by_pose, seen.view, views)
        self._views = sparse.hstack([by_pose, _columns(seen.by_lens, seen.lens, lenses)], format="csr")
        self._points = _columns(seen.by_point, seen.point, seen.point.max() + 1)
        self.count = 6 * views + 7 * lenses + 3 * (seen.point.max() + 1)
        self._seen = seen

    def cannot_explain(
        self, weight: Float[np.ndarray, " s"], columns: Float[np.ndarray, "s k"]
    ) -> Float[np.ndarray, "s k"]:
        """Return what is left of weighted columns after least squares by all unknowns, points eliminated first (Schur)."""
        by_weight = sparse.diags_array(weight)
        views, points, columns = by_weight @ self._views, by_weight @ self._points, columns * weight[:, None]
        inverse = self._inverse_of_points(weight)
        shared = points.T @ views
        normal = (views.T @ views - shared.T @ (inverse @ shared)).toarray()
        normal[np.diag_indices_from(normal)] *= 1 + _GAUGE
        wanted = views.T @ columns - shared.T @ (inverse @ (points.T @ columns))
        columns = columns - views @ np.linalg.solve(normal, wanted)
        return columns - points @ (inverse @ (points.T @ columns))

    def _inverse_of_points(self, weight: Float[np.ndarray, " s"]) -> sparse.csr_array:
        by_point, point = self._seen.by_point * weight.reshape(-1, 2, 1), self._seen.point
        blocks = np.zeros((point.max() + 1, 3, 3))
        np.add.at(blocks, point, np.einsum("tki,tkj->tij", by_point, by_point))
        blocks += _GAUGE * np.trace(blocks, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        return sparse.bsr_array((np.linalg.inv(blocks), np.arange(len(blocks)), np.arange(len(blocks) + 1))).tocsr()


def _columns(by: Float[np.ndarray, "t 2 k"], of: Int[np.ndarray, " t"], count: int) -> sparse.csr_array:
    """Spread what moves each observation over the columns of all `count` things that may."""
    t, _, k = by.shape
    column = np.broadcast_to((k * of[:, None] + np.arange(k))[:, None], by.shape)
    return sparse.csr_array((by.ravel(), column.ravel(), np.arange(0, 2 * t * k + 1, k)), shape=(2 * t, k * count))
