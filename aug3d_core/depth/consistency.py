"""What the depth maps of other photographs confirm. Plain numpy.

A pixel's point is looked up in the other's depth map; the point that map holds there must come back to the same pixel, at the
same depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, UInt8

from aug3d_core.depth.cameras import Camera, relative_pose

MOST_OFF_PX = 1.5
MOST_OFF_DEPTH = 0.01  # relative


@dataclass(frozen=True)
class DepthMap:
    """A depth map (0: none) and its camera."""

    depth: Float32[np.ndarray, "h w"]
    camera: Camera


@dataclass(frozen=True)
class Confirmed:
    """For each pixel of a depth map: what the others say."""

    agreeing: UInt8[np.ndarray, "h w"]  # others that see the place at this depth
    depth: Float32[np.ndarray, "h w"]  # mean of the map's own depth and theirs


def confirm(reference: DepthMap, others: list[DepthMap]) -> Confirmed:
    """Compare a depth map with those of others."""
    row, column = np.nonzero(reference.depth)
    own = reference.depth[row, column]
    points = reference.camera.rays.astype(np.float32)[row, column] * own[:, None]
    agreeing, total = np.zeros(len(row), np.uint8), own.copy()
    for other in others:
        confirmed, depth = _seen_back(reference.camera, points, row, column, other)
        agreeing[confirmed] += 1
        total[confirmed] += depth
    return Confirmed(
        _filled(reference, row, column, agreeing),
        _filled(reference, row, column, total / (agreeing + np.float32(1))),
    )


def _filled(reference: DepthMap, row: np.ndarray, column: np.ndarray, values: np.ndarray) -> np.ndarray:
    image = np.zeros(reference.depth.shape, values.dtype)
    image[row, column] = values
    return image


def _seen_back(
    camera: Camera, points: np.ndarray, row: np.ndarray, column: np.ndarray, other: DepthMap
) -> tuple[np.ndarray, np.ndarray]:
    """Return which points the other map confirms, and the depth it gives them here."""
    rotation, translation = (part.astype(np.float32) for part in relative_pose(camera, other.camera))
    there = points @ rotation.T + translation
    focal, middle = other.camera.intrinsics[:2].astype(np.float32), other.camera.intrinsics[2:].astype(np.float32)
    x, y = np.floor(there[:, :2] / np.maximum(there[:, 2:], np.float32(1e-6)) * focal + middle).T
    inside = np.flatnonzero(
        (there[:, 2] > 0) & (x >= 0) & (y >= 0) & (x < other.camera.width) & (y < other.camera.height)
    )
    x, y = x[inside].astype(int), y[inside].astype(int)
    depth_there = other.depth[y, x]
    rays = np.stack([(x + 0.5 - middle[0]) / focal[0], (y + 0.5 - middle[1]) / focal[1], np.ones(len(x))], axis=-1)
    back = (rays.astype(np.float32) * depth_there[:, None] - translation) @ rotation
    depth = np.maximum(back[:, 2], np.float32(1e-6))
    offset = back[:, :2] / depth[:, None] * camera.intrinsics[:2] + camera.intrinsics[2:] - 0.5
    off_px = np.hypot(offset[:, 0] - column[inside], offset[:, 1] - row[inside])
    off_depth = np.abs(depth / points[inside, 2] - 1)
    confirmed = (depth_there > 0) & (off_px < MOST_OFF_PX) & (off_depth < MOST_OFF_DEPTH)
    return inside[confirmed], depth[confirmed]
