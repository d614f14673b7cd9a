"""The texture: every texel is a place of the surface, coloured as a vertex is."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count

import numpy as np
from jaxtyping import Bool, Int, UInt8, UInt32
from scipy.ndimage import distance_transform_edt

from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.surface.atlas import Atlas
from aug3d_core.surface.colour import Photographs, Places
from aug3d_core.surface.shape import Shape, triangle_normals

_BITS = 16  # of a triangle's place on the ground, each way
CHUNK = 2**21  # texels coloured at a time: bounds memory at about 0.5 GiB
_STRIP = 2**24  # texels between which charts' neighbours are looked for at a time
_RIM = 64  # rows of texels: farther from a chart nobody looks


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
    triangle = atlas.triangle_of_texels()
    inside = _along_ground(triangle.ravel(), shape)
    texels = np.zeros((triangle.size, 3), np.uint8)
    normals = triangle_normals(shape)
    looks, passes = count(1), -(-len(inside) // CHUNK)

    def looked() -> None:
        if next(looks) % passes == 0:
            tick()

    for part in range(passes):
        some = inside[part * CHUNK : (part + 1) * CHUNK].astype(np.int64)
        hits = atlas.hits(some)
        corners = shape.triangles[hits.triangle]
        xyz = np.einsum("pk,pkx->px", hits.weights, shape.xyz[corners])
        colours = photographs.paint(Places(xyz, normals[hits.triangle]), best, looked, f"texels_{part:03}")
        guess = np.rint(np.einsum("pk,pkc->pc", hits.weights, rgb[corners])).astype(np.uint8)
        texels[some] = np.where(colours.known[:, None], colours.rgb, guess)
    picture = texels.reshape(*triangle.shape, 3)
    empty = triangle < 0
    for here, there in atlas.parts.shared():  # so that a cut through the ground is not seen
        beyond = empty[here] & ~empty[there]
        picture[here][beyond] = picture[there][beyond]
        empty[here][beyond] = False
    _fill_between(picture, empty)
    return TexturedMesh(shape.xyz, shape.triangles, atlas.uv, picture)


def _along_ground(triangle: Int[np.ndarray, " p"], shape: Shape) -> UInt32[np.ndarray, " q"]:
    """Return the numbers of the texels in triangles, so that what is close in the list is close on the ground.

    A photograph then shows few of the parts that texels are coloured in, and is read for these alone. Triangles follow each
    other along Morton's curve. Sorted by counting, a part at a time: a texture has more texels than anything else.
    """
    middle = shape.xyz[shape.triangles].mean(axis=1)[:, :2]
    low, wide = middle.min(axis=0), max(float(np.ptp(middle, axis=0).max()), 1e-9)
    column, row = ((middle - low) / wide * (2**_BITS - 1)).astype(np.int64).T
    place = np.argsort(np.argsort(_spread(column) | _spread(row) << 1, kind="stable"))
    parts = [slice(first, first + CHUNK) for first in range(0, len(triangle), CHUNK)]
    size = np.zeros(len(place), np.int64)
    for part in parts:
        size += np.bincount(place[triangle[part][triangle[part] >= 0]], minlength=len(place))
    following = np.cumsum(size) - size  # where the next texel of each triangle goes
    inside = np.empty(int(size.sum()), np.uint32)
    for part in parts:
        texel = np.flatnonzero(triangle[part] >= 0)
        of = place[triangle[part][texel]]
        order = np.argsort(of, kind="stable")
        of, texel = of[order], texel[order]
        inside[following[of] + np.arange(len(of)) - np.searchsorted(of, of)] = part.start + texel
        following += np.bincount(of, minlength=len(place))
    return inside


def _fill_between(picture: UInt8[np.ndarray, "h w 3"], empty: Bool[np.ndarray, "h w"]) -> None:
    """Give texels between charts the nearest texel's colour: sampling between texels looks a little beyond every rim."""
    height, width = empty.shape
    rows = max(_STRIP // width, _RIM)
    for top in range(0, height, rows):
        first, last = max(top - _RIM, 0), min(top + rows + _RIM, height)
        around = empty[first:last]
        if around.all():
            continue
        near = np.asarray(distance_transform_edt(around, return_distances=False, return_indices=True))
        here = np.s_[top - first : top - first + rows]
        row, column = np.nonzero(around[here])
        picture[top + row, column] = picture[first:last][near[0][here][row, column], near[1][here][row, column]]


def _spread(numbers: Int[np.ndarray, " t"]) -> Int[np.ndarray, " t"]:
    """Put a zero before each binary digit."""
    spread = np.zeros_like(numbers)
    for bit in range(_BITS):
        spread |= (numbers >> bit & 1) << 2 * bit
    return spread
