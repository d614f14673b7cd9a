"""Families of parallel planes to try, no more than the photographs can tell apart. Plain numpy.

A family is a normal n in the reference camera's frame and a range of distances d: the planes are n . X = d, so that the
depth at a pixel with ray r (z = 1) is d / (n . r). Each step moves the pixels that the sources show by as much. Even steps of
1 / d do so only for cameras side by side: between cameras that look at one place from all around, a pixel crawls at one end of
the range and races out of the picture at the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from aug3d_core.depth.cameras import Camera, relative_pose

MOST_PLANES = 1024  # a source that nearly touches what it sees would ask for any number
_FEWEST_PLANES = 3
_PROBES = 9  # pixels along each side of the reference at which shifts are measured
_PARTS = 128  # of the range, in each of which they are
_USUAL_PCT = 90.0  # of the probes that a source shows


@dataclass(frozen=True)
class Family:
    """Parallel planes, nearest last."""

    normal: Float[np.ndarray, " 3"]
    inverse_distance: Float[np.ndarray, " k"]


def horizontal_normal(camera: Camera) -> Float[np.ndarray, " 3"]:
    """Return the downward vertical in the camera's frame."""
    return -camera.cam_from_world[:, 2]


def make_family(
    reference: Camera,
    sources: list[Camera],
    normal: Float[np.ndarray, " 3"],
    nearest: float,
    farthest: float,
    step_px: float,
) -> Family:
    """Return planes from `farthest` to `nearest`, no source pixel moving more than `step_px` between two."""
    inverse = np.linspace(1 / farthest, 1 / nearest, _PARTS + 1)
    rows, columns = (np.linspace(0, side - 1, _PROBES).astype(int) for side in (reference.height, reference.width))
    rays = reference.rays[rows][:, columns].reshape(-1, 3)
    depth = 1 / (inverse[:, None] * (rays @ normal))
    moved = np.max([_moved_px(reference, source, rays, depth) for source in sources], axis=0)
    moved = np.maximum(moved, (_FEWEST_PLANES - 1) * step_px / _PARTS)  # what no source shows is passed in a few planes
    path = np.concatenate([[0.0], np.cumsum(moved)])
    count = int(np.clip(np.ceil(path[-1] / step_px) + 1, _FEWEST_PLANES, MOST_PLANES))
    return Family(normal, np.interp(np.linspace(0.0, path[-1], count), path, inverse))


def _moved_px(
    reference: Camera, source: Camera, rays: Float[np.ndarray, "p 3"], depth: Float[np.ndarray, "k p"]
) -> Float[np.ndarray, " k-1"]:
    """Return how far a pixel that the source shows travels from each plane to the next; 0 where it shows none.

    rays: of the probes in the reference's frame, z = 1. depth: of each plane along them.
    """
    rotation, translation = relative_pose(reference, source)
    points = (depth[..., None] * rays) @ rotation.T + translation
    ahead = (points[..., 2] > 0) & (depth > 0)
    at_px = (
        points[..., :2] / np.where(ahead, points[..., 2], 1.0)[..., None] * source.intrinsics[:2]
        + source.intrinsics[2:]
    )
    shown = ahead & (at_px >= 0).all(axis=-1) & (at_px <= [source.width, source.height]).all(axis=-1)
    length = np.linalg.norm(np.diff(at_px, axis=0), axis=-1)
    counts = (shown[1:] | shown[:-1]) & ahead[1:] & ahead[:-1]
    return _usual(length, counts)


def _usual(length: Float[np.ndarray, "k p"], counts: Bool[np.ndarray, "k p"]) -> Float[np.ndarray, " k"]:
    """Return for each row NumPy's percentile of what counts, to the bit, 0 where nothing does: a call for each takes long."""
    last = np.maximum(counts.sum(axis=1) - 1, 0)
    ordered = np.sort(np.where(counts, length, np.inf), axis=1)
    ordered[np.isinf(ordered)] = 0.0
    rank = last * (_USUAL_PCT / 100)
    floor = np.floor(rank).astype(int)
    rows = np.arange(len(length))
    low, high, part = ordered[rows, floor], ordered[rows, np.minimum(floor + 1, last)], rank - floor
    return np.where(part < 0.5, low + (high - low) * part, high - (high - low) * (1 - part))
