"""No more triangles than the surface needs: the coarsest mesh that stays within a distance of the fine one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.surface.poisson import simplify
from aug3d_core.surface.shape import Shape, drop_degenerate

PERCENTILE = 95.0  # of the distance from the fine mesh's vertices; the rest are spikes and rims that need not be kept
PROBES = 50_000
FEWEST = 500  # triangles: below, nothing is gained


@dataclass(frozen=True)
class Decimated:
    """The coarse mesh and its measured distance from the fine one."""

    shape: Shape
    error: float  # world units, at PERCENTILE


def decimate(fine: Shape, bound: float) -> Decimated:
    """Halve the triangles while the mesh stays within `bound` (world units) of the fine one, then once by less.

    Each round starts from the last, which costs half as much as starting anew and was as accurate.
    """
    best, probes = Decimated(fine, 0.0), fine.xyz[:: -(-len(fine.xyz) // PROBES)]
    for factor in (0.5, 0.5**0.5):
        while len(best.shape.triangles) > FEWEST:
            coarser = drop_degenerate(simplify(best.shape, int(factor * len(best.shape.triangles))))
            error = _distance(coarser, probes)
            if error > bound or len(coarser.triangles) >= len(best.shape.triangles):
                break
            best = Decimated(coarser, error)
    return best


def _distance(shape: Shape, probes: Float[np.ndarray, "p 3"]) -> float:
    return float(np.percentile(Raycaster(shape.xyz, shape.triangles).distance(probes), PERCENTILE))
