"""Depth that hangs together: small islands are dropped, and what is left open is filled from sweeps at smaller sizes. OpenCV.

Leaves match by chance in a small window; at a smaller size the same window holds a whole branch.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float32

ISLAND_PX = 40
_STEP = 10  # thousandths of the depth by which neighbours of one surface differ at most: facades are seen aslant


def without_islands(depth: Float32[np.ndarray, "h w"], smallest_px: int = ISLAND_PX) -> Float32[np.ndarray, "h w"]:
    """Return the depth map without connected pieces of fewer pixels; 0 stands for no depth."""
    known = depth > 0
    if not known.any():
        return depth
    nearest = float(depth[known].min())
    levels = np.zeros(depth.shape, np.int16)
    levels[known] = np.minimum(np.rint(1000 * np.log(depth[known] / nearest)) + 100, 32000).astype(np.int16)
    cv2.filterSpeckles(levels, 0, smallest_px, _STEP)
    return np.where(levels > 0, depth, np.float32(0))


def filled(fine: Float32[np.ndarray, "h w"], coarse: Float32[np.ndarray, "h2 w2"]) -> Float32[np.ndarray, "h w"]:
    """Return the fine map, and in its holes the coarse one."""
    height, width = fine.shape
    enlarged = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_NEAREST)
    return np.where(fine > 0, fine, enlarged)
