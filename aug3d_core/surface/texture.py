"""The texture: every texel is a place of the surface, coloured as a vertex is."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count

import numpy as np
from jaxtyping import Bool, Int, UInt8
from scipy.ndimage import distance_transform_edt

from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.surface.atlas import Atlas
from aug3d_core.surface.colour import Photographs, Places
from aug3d_core.surface.shape import Shape, triangle_normals

TILE = 32  # texels: what is close in the picture mostly is on the surface
CHUNK = 2**21  # texels coloured at a time: bounds memory at about 0.5 GiB


def paint_texture(
    photographs: Photographs,
    shape: Shape,
    rgb: UInt8[np.ndarray, "v 3"],
    atlas: Atlas,
    best: int,
    tick: Callable[[], None],
) -> TexturedMesh:
    """Fill an atlas from the photographs; texels that none sees take the blend of their corners' colours `rgb`.

    `tick` is called as often as there are photographs, evenly over the work.
    """
    triangle, weights = atlas.raster()
    inside = _by_tile(triangle >= 0)
    texels = np.zeros((triangle.size, 3), np.uint8)
    normals = triangle_normals(shape)
    looks, passes = count(1), -(-len(inside) // CHUNK)

    def looked() -> None:
        if next(looks) % passes == 0:
            tick()

    for part in range(passes):
        some = inside[part * CHUNK : (part + 1) * CHUNK]
        owner, weight = triangle.ravel()[some], weights.reshape(-1, 3)[some]
        corners = shape.triangles[owner]
        xyz = np.einsum("pk,pkx->px", weight, shape.xyz[corners])
        colours = photographs.paint(Places(xyz, normals[owner]), best, looked, f"texels_{part:03}")
        guess = np.rint(np.einsum("pk,pkc->pc", weight, rgb[corners])).astype(np.uint8)
        texels[some] = np.where(colours.known[:, None], colours.rgb, guess)
    picture = texels.reshape(*triangle.shape, 3)
    # Between charts, the nearest texel's colour: sampling between texels looks a little beyond every rim
    row, column = np.asarray(distance_transform_edt(triangle < 0, return_distances=False, return_indices=True))
    return TexturedMesh(shape.xyz, shape.triangles, atlas.uv, picture[row, column])


def _by_tile(wanted: Bool[np.ndarray, "h w"]) -> Int[np.ndarray, " p"]:
    """Return the flat indices of the wanted texels, tile after tile."""
    row, column = np.nonzero(wanted)
    order = np.lexsort((column // TILE, row // TILE))
    return row[order] * wanted.shape[1] + column[order]
