"""A village whose buildings are known exactly: houses and trees on ground that may rise, and a flight straight over it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Views
from aug3d_core.town.truth.patchwork import block, ground, patchwork

_HALF_M, _PLOT_M = 60.0, 30.0  # of the world, and of the square plot that holds at most one house
_ALTITUDE_M, _SIZE, _FOCAL_PX = 60.0, (160, 120), 130.0
_HOUSE_M, _HIGH_M = (9.0, 14.0), (5.0, 9.0)
_CROWN_M, _TREE_M = (4.5, 7.0), (5.0, 9.0)  # as wide and as high as small houses: only colour tells them apart
_LEAVES, _TWIGS = (70, 110, 50), (120, 100, 85)

Land = Callable[[Float[np.ndarray, "*n"]], Float[np.ndarray, "*n"]]  # height of the ground (m) at a y (m)


def slope(rise_deg: float) -> Land:
    """Let the ground rise evenly to the north."""
    return lambda y: np.tan(np.radians(rise_deg)) * np.asarray(y)


def terrace(step_m: float) -> Land:
    """Let the northern half of the ground be higher."""
    return lambda y: step_m * (np.asarray(y) > 0.0)


@dataclass(frozen=True)
class Village:
    """A mesh, the boxes of its houses (west, south, east, north) in metres, and the photos of a flight over it."""

    mesh: Mesh
    boxes: Float[np.ndarray, "b 4"]
    photos: Views


def village(houses: int, green: int, bare: int, land: Land, rng: np.random.Generator) -> Village:
    """Build up to 16 houses, and trees with and without leaves between them."""
    plots = [(x, y) for x in np.arange(-45.0, 46.0, _PLOT_M) for y in np.arange(-45.0, 46.0, _PLOT_M)]
    floor = patchwork([ground(_HALF_M, _HALF_M)], rng)
    floor.xyz[:, 2] = land(floor.xyz[:, 1])
    parts, boxes = [floor], np.zeros((0, 4))
    for plot in rng.permutation(len(plots))[:houses]:
        middle, size = np.array(plots[plot]) + rng.uniform(-3, 3, 2), rng.uniform(*_HOUSE_M, 2)
        parts.append(_standing(middle, size, rng.uniform(*_HIGH_M), None, land, rng))
        boxes = np.vstack([boxes, np.concatenate([middle - size / 2, middle + size / 2])])
    for tree in range(green + bare):
        size = np.full(2, rng.uniform(*_CROWN_M))
        middle = _between(boxes, size[0], rng)
        parts.append(_standing(middle, size, rng.uniform(*_TREE_M), _LEAVES if tree < green else _TWIGS, land, rng))
    return Village(_joined(parts), boxes, _flight(land))


def _between(boxes: Float[np.ndarray, "b 4"], width: float, rng: np.random.Generator) -> Float[np.ndarray, " 2"]:
    """Return a place off the houses; crowns may touch one another."""
    while True:
        place = rng.uniform(-_HALF_M + width, _HALF_M - width, 2)
        near = (place > boxes[:, :2] - width).all(axis=1) & (place < boxes[:, 2:] + width).all(axis=1)
        if not near.any():
            return place


def _standing(
    middle: np.ndarray,
    size: np.ndarray,
    high: float,
    colour: tuple[int, int, int] | None,
    land: Land,
    rng: np.random.Generator,
) -> Mesh:
    """Return a block as high as this above the ground at its middle; its foot reaches the ground wherever it falls."""
    corners = land(middle[1] + np.array([-0.5, 0.0, 0.5]) * size[1])
    below = float(corners[1] - corners.min())
    mesh = patchwork(block((middle[0], middle[1]), (size[0], size[1], high + below)), rng)
    mesh.xyz[:, 2] += corners.min()
    if colour is None:
        return mesh
    return Mesh(mesh.xyz, np.rint(rng.uniform(0.8, 1.0, (len(mesh.rgb), 1)) * colour).astype(np.uint8), mesh.triangles)


def _joined(parts: list[Mesh]) -> Mesh:
    first = np.cumsum([0, *(len(part.xyz) for part in parts[:-1])])
    return Mesh(
        np.concatenate([part.xyz for part in parts]),
        np.concatenate([part.rgb for part in parts]),
        np.concatenate([part.triangles + start for part, start in zip(parts, first, strict=True)]).astype(np.int32),
    )


def _flight(land: Land) -> Views:
    """Photograph straight down every 20 m, always as high above the ground."""
    steps = np.arange(-50.0, 51.0, 20.0)
    eyes = [np.array([x, y, float(land(y)) + _ALTITUDE_M]) for x in steps for y in steps]
    poses = np.stack([look_at(eye, eye - [0.0, 0.0, 1.0]) for eye in eyes])
    intrinsics = np.tile([_FOCAL_PX, _FOCAL_PX, _SIZE[0] / 2, _SIZE[1] / 2], (len(eyes), 1))
    return Views(np.arange(len(eyes)), poses, intrinsics, np.tile(_SIZE, (len(eyes), 1)))
