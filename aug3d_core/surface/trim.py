"""A surface only where points speak for it: Poisson's goes on everywhere, and most of that is an invention."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import KDTree

from aug3d_core.geometry.ground_tiles import EVERYWHERE, Tile
from aug3d_core.surface.evidence import Evidence
from aug3d_core.surface.shape import Shape, drop_small_pieces

REACH = 2.0  # spacings around a point in which it speaks for the surface


def trim(shape: Shape, evidence: Evidence, max_gap: float, min_points: int, read: Tile = EVERYWHERE) -> Shape:
    """Cut what no point supports, close holes of up to `max_gap` across, and drop loose pieces of too few points.

    A piece that reaches the end of the ground whose points were `read` may go on beyond it, and stays.
    """
    kept = shape.keep(_supported(shape.xyz, evidence, max_gap / 2)[shape.triangles].all(axis=1))
    if not len(kept.triangles):
        return kept
    # Points, not area: around a few stray ones Poisson blows a bubble of many triangles
    distance, vertex = map(np.asarray, KDTree(kept.xyz).query(evidence.xyz))
    reach = REACH * evidence.spacing
    points = np.bincount(vertex[distance <= reach], minlength=len(kept.xyz)).astype(float)
    points[~read.grown(-reach).holds(kept.xyz)] = np.inf
    return drop_small_pieces(kept, points, min_points)


def bridged(shape: Shape, evidence: Evidence) -> Bool[np.ndarray, " t"]:
    """Tell which triangles no point speaks for: gaps that were closed."""
    middles = shape.xyz[shape.triangles].mean(axis=1)
    return np.asarray(KDTree(evidence.xyz).query(middles)[0]) > REACH * evidence.spacing


def _supported(xyz: Float[np.ndarray, "v 3"], evidence: Evidence, radius: float) -> Bool[np.ndarray, " v"]:
    """Tell which vertices are near a point, or in a gap between points: a morphological closing along the surface.

    The points' surroundings grow by `radius` and shrink by it again: a gap narrower than twice that has vanished in
    between, and round the outside nothing is left of the growth.
    """
    distance = np.asarray(KDTree(evidence.xyz).query(xyz)[0])
    near, far = distance <= REACH * evidence.spacing, distance > radius
    if not far.any():
        return near | ~far
    return near | (np.asarray(KDTree(xyz[far]).query(xyz)[0]) > radius)
