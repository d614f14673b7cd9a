"""The texture: every texel is a place of the surface, coloured as a vertex is."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count

import numpy as np
from jaxtyping import Int, UInt8
from scipy.ndimage import distance_transform_edt

from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.surface.atlas import Atlas
from aug3d_core.surface.colour import Photographs, Places
from aug3d_core.surface.shape import Shape, triangle_normals

_BITS = 16  # of a triangle's place on the ground, each way
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
    inside = _along_ground(triangle, shape)
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


def _along_ground(triangle: Int[np.ndarray, "h w"], shape: Shape) -> Int[np.ndarray, " p"]:
    """Return the flat indices of the texels in triangles, so that what is close in the list is close on the ground.

    A photograph then shows few of the parts that texels are coloured in, and is read for these alone. Triangles follow each
    other along Morton's curve.
    """
    middle = shape.xyz[shape.triangles].mean(axis=1)[:, :2]
    low, wide = middle.min(axis=0), max(float(np.ptp(middle, axis=0).max()), 1e-9)
    column, row = ((middle - low) / wide * (2**_BITS - 1)).astype(np.int64).T
    place = np.argsort(np.argsort(_spread(column) | _spread(row) << 1, kind="stable")).astype(np.int32)
    inside = np.flatnonzero(triangle >= 0)
    return inside[np.argsort(place[triangle.ravel()[inside]], kind="stable")]


def _spread(numbers: Int[np.ndarray, " t"]) -> Int[np.ndarray, " t"]:
    """Put a zero before each binary digit."""
    spread = np.zeros_like(numbers)
    for bit in range(_BITS):
        spread |= (numbers >> bit & 1) << 2 * bit
    return spread
