"""The ground under stored points in tiles of about equal numbers of them.

The points of one tile, and a margin around it, are held at a time, and its octree is as fine as its own points allow.
"""

from __future__ import annotations

import numpy as np

from aug3d_core.geometry.ground_tiles import Halved, Planned, halve
from aug3d_core.geometry.stored_points import StoredPoints

# Three million points take 2 GiB (0.7 KiB each at cells of two spacings, measured), and lie on about 1,700 x 1,700 of their
# spacings: the deepest octree has cells for 3,700
MOST_POINTS = 3_000_000
SAMPLE = 200_000  # points that tell where to halve the ground
PART = 1_000_000  # points that are read at a time


def plan_tiles(stored: StoredPoints, most: int) -> Halved | Planned:
    """Halve the ground under stored points until about `most` of them at most are in a tile."""
    step = -(-len(stored) // SAMPLE)
    firsts = range(0, len(stored), PART)  # copies, or each would keep all of its part
    sample = np.concatenate(
        [stored.xyz(first, first + PART)[-first % step :: step].astype(np.float64) for first in firsts]
    )
    return halve(sample[np.isfinite(sample).all(axis=1), :2], step, most)
