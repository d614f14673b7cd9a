"""How finely the photographs justify looking at each part of the surface.

The photographs' median is not enough: where they see the surface from afar and aslant, its shape and texture are smeared
over many pixels of a view that is as fine as elsewhere. Two photographs must see a place, for its shape comes from two.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from aug3d_core.domes.sight import spread_over
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.views import Views

POINTS = 20_000
NEAREST = 8  # points that speak for a triangle
MOST_ASLANT = np.cos(np.radians(87.0))


def sampling_by_photos(
    mesh: Mesh, surface: Raycaster, photos: Views, rng: np.random.Generator
) -> Float[np.ndarray, " t"]:
    """Return for each triangle the size of a pixel on it (world units), in the second best photo about; inf without.

    The size is that along the longer side of the pixel's footprint, which grows the more aslant the photo sees it.
    """
    samples = spread_over(mesh, POINTS, np.zeros(1), rng)
    best = np.full((2, len(samples.xyz)), np.inf)
    for pose, lens, size in zip(photos.cam_from_world, photos.intrinsics, photos.size, strict=True):
        point, depth, towards = samples.visible(surface, pose, lens, size, MOST_ASLANT)
        aslant = np.einsum("pk,pk->p", towards, samples.normal[point])
        footprint = depth / lens[0] / aslant
        best[:, point] = np.sort([*best[:, point], footprint], axis=0)[:2]
    middle = mesh.xyz[mesh.triangles].mean(axis=1)
    return np.median(best[1][KDTree(samples.xyz).query(middle, NEAREST)[1]], axis=1)
