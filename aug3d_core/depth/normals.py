"""Depth map -> normal map.

On a plane, inverse depth is linear in the pixel coordinates: n . X = d gives 1/z = (n . r) / d with the ray r. A least squares
line through the inverse depths of a window gives n up to its length.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float32

from aug3d_core.depth.cameras import Camera

_WINDOW_PX = 7
_RIDGE = 1e-3  # keeps the fit defined where a window holds one row of pixels: the surface then faces the camera


def normals_of(depth: Float32[np.ndarray, "h w"], camera: Camera) -> Float32[np.ndarray, "h w 3"]:
    """Return unit normals in the camera's frame, towards the camera; 0 where there is no depth."""
    known = (depth > 0).astype(np.float64)
    inverse = np.divide(1.0, depth, out=np.zeros(depth.shape), where=depth > 0)
    x = np.arange(camera.width, dtype=float)[None, :] + np.zeros(depth.shape)
    y = np.arange(camera.height, dtype=float)[:, None] + np.zeros(depth.shape)
    count, mean_x, mean_y, mean_v = _box(known), _box(known * x), _box(known * y), _box(known * inverse)
    count = np.maximum(count, 1e-9)
    mean_x, mean_y, mean_v = mean_x / count, mean_y / count, mean_v / count
    xx = _box(known * x * x) / count - mean_x**2 + _RIDGE
    yy = _box(known * y * y) / count - mean_y**2 + _RIDGE
    xy = _box(known * x * y) / count - mean_x * mean_y
    xv = _box(known * x * inverse) / count - mean_x * mean_v
    yv = _box(known * y * inverse) / count - mean_y * mean_v
    determinant = np.maximum(xx * yy - xy**2, 1e-9)
    slope_x, slope_y = (yy * xv - xy * yv) / determinant, (xx * yv - xy * xv) / determinant
    level = mean_v - slope_x * mean_x - slope_y * mean_y
    normal = -np.stack([slope_x, slope_y, level], axis=-1) @ camera.matrix
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-30)
    return np.where((depth > 0)[..., None], normal, 0.0).astype(np.float32)


def _box(values: np.ndarray) -> np.ndarray:
    return cv2.boxFilter(values, cv2.CV_64F, (_WINDOW_PX, _WINDOW_PX), borderType=cv2.BORDER_CONSTANT)
