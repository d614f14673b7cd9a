"""Plane sweep: for each pixel the plane on which the source photographs agree best with it. The door to OpenCV.

Each plane warps each source onto the reference (Collins 1996); agreement is normalised cross-correlation over a window.
A pixel's score is the mean of the better half of its sources, because the rest may not see the place (Kang et al. 2001).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import ceil

import cv2
import numpy as np
from jaxtyping import Float, Float32, UInt8

from aug3d_core.depth.cameras import Camera, relative_pose
from aug3d_core.depth.planes import Family

WINDOW_PX = 5  # 7 and 9 lose edges and facades (1.4 and 2.4 points of pixels within 0.5 % of the town's exact depth)
_MISSING = np.float32(0.1)  # of the score of a better source, where an image ends
_FLAT = 4.0  # grey levels squared: variance below which a window has no texture to compare

Part = tuple[slice, slice]  # rows, columns of an image


@dataclass(frozen=True)
class Photo:
    """A grey image, 1 to 255 (0 stands for outside, and for what is masked), and its camera."""

    grey: UInt8[np.ndarray, "h w"]
    camera: Camera


@dataclass(frozen=True)
class Sweep:
    """The best plane of each pixel."""

    depth: Float32[np.ndarray, "h w"]
    score: Float32[np.ndarray, "h w"]  # -1 to 1


class Reference:
    """A photograph prepared for comparison with warped sources."""

    def __init__(self, grey: UInt8[np.ndarray, "h w"]) -> None:
        self._grey = grey
        window = (WINDOW_PX, WINDOW_PX)
        self._mean = cv2.boxFilter(grey, cv2.CV_32F, window)
        variance = cv2.sqrBoxFilter(grey, cv2.CV_32F, window) - self._mean**2
        self._variance = np.maximum(variance, _FLAT)

    def correlation(self, warped: UInt8[np.ndarray, "y x"], part: Part) -> Float32[np.ndarray, "h w"]:
        """Return NCC in a window about each pixel; -1 where the warped image, which covers a part, has nothing."""
        whole = np.full(self._grey.shape, -1.0, np.float32)
        if warped.size:
            whole[part] = self._correlation(warped, part)
        return whole

    def _correlation(self, warped: UInt8[np.ndarray, "y x"], part: Part) -> Float32[np.ndarray, "y x"]:
        window = (WINDOW_PX, WINDOW_PX)
        mean = cv2.boxFilter(warped, cv2.CV_32F, window)
        variance = cv2.sqrBoxFilter(warped, cv2.CV_32F, window)
        together = cv2.boxFilter(cv2.multiply(self._grey[part], warped, dtype=cv2.CV_16U), cv2.CV_32F, window)
        together -= self._mean[part] * mean
        mean *= mean
        variance -= mean
        np.maximum(variance, _FLAT, out=variance)
        variance *= self._variance[part]
        np.sqrt(variance, out=variance)
        together /= variance
        together[warped == 0] = -1.0
        return together


def better_half(scores: list[np.ndarray]) -> Float32[np.ndarray, "h w"]:
    """Return the mean of the better half of the scores at each pixel, rounded up: 1 of 2, 2 of 4.

    A score of -1 is no score: the source's image ends there. Where the better half has too few, the next worse one is taken
    for a little less than the one before, so that a place near the rim competes with places that all sources see.
    """
    best, wanted = [scores[0].copy()], ceil(len(scores) / 2)
    for score in scores[1:]:
        for rank in best:
            worse = np.minimum(rank, score)
            np.maximum(rank, score, out=rank)
            score = worse
        if len(best) < wanted:
            best.append(score)
    for better, rank in pairwise(best):
        np.copyto(rank, better - _MISSING, where=rank == -1)
    return sum(best[1:], best[0]) / np.float32(len(best))


def sweep(reference: Photo, sources: list[Photo], families: list[Family]) -> Sweep:
    """Try every plane of every family; the best one is refined to a fraction of a plane by a parabola."""
    prepared = Reference(reference.grey)
    best = _empty(reference.camera)
    for family in families:
        best = _better(best, _sweep_family(prepared, reference.camera, sources, family))
    return best


def _sweep_family(prepared: Reference, camera: Camera, sources: list[Photo], family: Family) -> Sweep:
    shape = (camera.height, camera.width)
    score = np.full(shape, -1.0, np.float32)
    plane = np.zeros(shape, np.float32)
    before, after = np.full(shape, -1.0, np.float32), np.full(shape, -1.0, np.float32)
    last = np.full(shape, -1.0, np.float32)
    was_best = np.zeros(shape, bool)
    for index, inverse in enumerate(family.inverse_distance):
        now = better_half([prepared.correlation(*_warp(camera, source, family.normal, inverse)) for source in sources])
        np.copyto(after, now, where=was_best)
        was_best = now > score
        np.copyto(before, last, where=was_best)
        np.copyto(score, now, where=was_best)
        plane[was_best] = index
        last = now
    plane += _parabola_offset(before, score, after)
    inverse = np.interp(plane, np.arange(len(family.inverse_distance)), family.inverse_distance)
    with np.errstate(divide="ignore"):
        depth = 1 / (inverse * (camera.rays @ family.normal))
    depth[~np.isfinite(depth) | (depth < 0)] = 0.0
    return Sweep(depth.astype(np.float32), score)


def _warp(camera: Camera, source: Photo, normal: np.ndarray, inverse: float) -> tuple[UInt8[np.ndarray, "y x"], Part]:
    """Return the source as the reference would see it if all of it lay on the plane n . X = 1 / inverse, and which part of the
    reference that covers: the rest shows nothing, and half of the time is saved by leaving it out.
    """
    rotation, translation = relative_pose(camera, source.camera)
    to_source = (
        source.camera.matrix @ (rotation + np.outer(translation, normal) * inverse) @ np.linalg.inv(camera.matrix)
    )
    rows, columns = part = _part(to_source, source.camera, camera)
    size = columns.stop - columns.start, rows.stop - rows.start
    if not min(size):
        return np.zeros(size[::-1], np.uint8), part
    moved = to_source @ np.array([[1.0, 0.0, columns.start], [0.0, 1.0, rows.start], [0.0, 0.0, 1.0]])
    return cv2.warpPerspective(source.grey, moved, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP), part


def _part(to_source: Float[np.ndarray, "3 3"], source: Camera, reference: Camera) -> Part:
    """Return the part of the reference that maps into the source, and a window's margin; all of it where that has no bounds."""
    a, b, c = to_source.T
    from_source = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)])  # the inverse, up to a factor
    corners = np.array([[x, y, 1.0] for x in (-1.0, source.width) for y in (-1.0, source.height)]) @ from_source.T
    if not (corners[:, 2] > 0).all() and not (corners[:, 2] < 0).all():
        return slice(0, reference.height), slice(0, reference.width)
    at_px = corners[:, :2] / corners[:, 2:]
    low, high = np.floor(at_px.min(axis=0)) - WINDOW_PX, np.ceil(at_px.max(axis=0)) + WINDOW_PX
    (left, right), (top, bottom) = (
        np.clip([low[axis], max(high[axis], low[axis])], 0, side).astype(int).tolist()
        for axis, side in enumerate((reference.width, reference.height))
    )
    return slice(top, bottom), slice(left, right)


def _parabola_offset(before: np.ndarray, best: np.ndarray, after: np.ndarray) -> Float32[np.ndarray, "h w"]:
    """Return where the parabola through three neighbouring scores peaks, in steps from the middle one."""
    curvature = before - 2 * best + after
    offset = np.where(curvature < -1e-6, 0.5 * (before - after) / np.minimum(curvature, -1e-6), 0.0)
    return np.clip(offset, -0.5, 0.5).astype(np.float32)


def _empty(camera: Camera) -> Sweep:
    shape = (camera.height, camera.width)
    return Sweep(np.zeros(shape, np.float32), np.full(shape, -1.0, np.float32))


def _better(one: Sweep, other: Sweep) -> Sweep:
    take = (other.score > one.score) & (other.depth > 0)
    return Sweep(np.where(take, other.depth, one.depth), np.where(take, other.score, one.score))
