"""A surface only where points speak for it: Poisson's goes on everywhere, and most of that is an invention."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from aug3d_core.surface.evidence import Evidence
from aug3d_core.surface.shape import Shape, drop_small_pieces, triangle_pieces

REACH = 2.0  # spacings around a point in which it speaks for the surface


def trim(shape: Shape, evidence: Evidence, max_gap: float, min_piece: float) -> Shape:
    """Cut what no point supports, close holes of up to `max_gap` across, and drop loose pieces below an area."""
    distance = np.asarray(KDTree(evidence.xyz).query(shape.xyz)[0])[shape.triangles].max(axis=1)
    bare = distance > REACH * evidence.spacing
    patch = triangle_pieces(Shape(shape.xyz, shape.triangles[bare]))
    widest = np.zeros(patch.max(initial=-1) + 1)
    np.maximum.at(widest, patch, distance[bare])
    keep = ~bare
    # A narrow patch has supported surface on both sides. What lies around the points is one patch, and wide
    keep[bare] = widest[patch] <= max_gap / 2
    return drop_small_pieces(shape.keep(keep), min_piece)
