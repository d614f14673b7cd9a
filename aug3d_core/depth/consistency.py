"""What the depth maps of other photographs confirm. Plain numpy.

A pixel's point is looked up in the other's depth map; the point that map holds there must come back to the same pixel, at the
same depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, UInt8

from aug3d_core.depth.cameras import Camera, relative_pose

MOST_OFF_PX = 1.0
MOST_OFF_DEPTH = 0.01  # relative


@dataclass(frozen=True)
class DepthMap:
    """A depth map (0: none) and its camera."""

    depth: Float32[np.ndarray, "h w"]
    camera: Camera


def confirmations(
    reference: DepthMap, others: list[DepthMap]
) -> tuple[UInt8[np.ndarray, "h w"], Float32[np.ndarray, "h w"]]:
    """Return how many others confirm each pixel, and the mean of its depth and of the depths they give it."""
    count = np.zeros(reference.depth.shape, np.uint8)
    total = reference.depth.astype(np.float64)
    row, column = np.nonzero(reference.depth)
    points = reference.camera.rays[row, column] * reference.depth[row, column, None]
    for other in others:
        confirmed, depth = _seen_back(reference.camera, points, row, column, other)
        count[row[confirmed], column[confirmed]] += 1
        total[row[confirmed], column[confirmed]] += depth[confirmed]
    return count, (total / (count + 1.0)).astype(np.float32)


def _seen_back(
    camera: Camera, points: np.ndarray, row: np.ndarray, column: np.ndarray, other: DepthMap
) -> tuple[np.ndarray, np.ndarray]:
    """Return which points the other map confirms, and the depth it gives them in the reference camera."""
    rotation, translation = relative_pose(camera, other.camera)
    there = points @ rotation.T + translation
    ahead = there[:, 2] > 0
    pixel = np.full((len(points), 2), -1.0)
    pixel[ahead] = there[ahead, :2] / there[ahead, 2:] * other.camera.intrinsics[:2] + other.camera.intrinsics[2:]
    x, y = np.floor(pixel).astype(int).T
    inside = (x >= 0) & (y >= 0) & (x < other.camera.width) & (y < other.camera.height)
    x, y = np.where(inside, x, 0), np.where(inside, y, 0)
    depth_there = np.where(inside, other.depth[y, x], 0.0)
    back = (other.camera.rays[y, x] * depth_there[:, None] - translation) @ rotation
    depth = np.maximum(back[:, 2], 1e-9)
    offset = back[:, :2] / depth[:, None] * camera.intrinsics[:2] + camera.intrinsics[2:] - 0.5
    off_px = np.hypot(offset[:, 0] - column, offset[:, 1] - row)
    off_depth = np.abs(depth - points[:, 2]) / points[:, 2]
    return (depth_there > 0) & (off_px < MOST_OFF_PX) & (off_depth < MOST_OFF_DEPTH), depth
