"""Small exact worlds of rectangles, a patchwork of squares whose colour tells where they are.

Redder to the east, greener to the north; walls are orange to the south, violet to the north, grey else; roofs are white.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from aug3d_core.geometry.ply import Mesh

_SQUARE_M = 4.0
_SHADE = 0.35  # of its brightness by which a square may be darker than its neighbours
_UP = 0.5  # z of a unit normal from which a rectangle lies
_SOUTH, _NORTH, _SIDE, _ROOF = (240, 140, 40), (140, 70, 220), (130, 130, 130), (245, 245, 245)


def patchwork(rectangles: Iterable[Float[np.ndarray, "3 3"]], rng: np.random.Generator) -> Mesh:
    """Return the mesh of some rectangles, each given by three corners: an origin and the ends of its two sides (m)."""
    corners = np.concatenate([_squares(rectangle) for rectangle in rectangles])
    colours = _paint(corners) * (1 - _SHADE * rng.random((len(corners), 1)))
    first = 4 * np.arange(len(corners))[:, None, None]
    triangles = (first + np.array([(0, 1, 2), (0, 2, 3)])).reshape(-1, 3).astype(np.int32)
    return Mesh(corners.reshape(-1, 3).astype(np.float32), np.repeat(colours.astype(np.uint8), 4, axis=0), triangles)


def ground(half_x_m: float, half_y_m: float) -> Float[np.ndarray, "3 3"]:
    """Return level ground about the origin."""
    return np.array([(-half_x_m, -half_y_m, 0.0), (half_x_m, -half_y_m, 0.0), (-half_x_m, half_y_m, 0.0)])


def block(centre_m: tuple[float, float], size_m: tuple[float, float, float]) -> list[Float[np.ndarray, "3 3"]]:
    """Return the roof and the walls of a building, by the middle of its foot and its width, depth and height."""
    (x, y), (width, depth, height) = np.array(centre_m), size_m
    a, b, c, d = (
        np.array((x + i * width / 2, y + j * depth / 2, 0.0)) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    )
    up = np.array((0.0, 0.0, height))
    walls = [np.stack([p, q, p + up]) for p, q in ((a, b), (b, c), (c, d), (d, a))]
    return [np.stack([a, b, d]) + up, *walls]


def _squares(rectangle: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "n 4 3"]:
    origin, along, across = rectangle[0], rectangle[1] - rectangle[0], rectangle[2] - rectangle[0]
    counts = [max(1, round(float(np.linalg.norm(side)) / _SQUARE_M)) for side in (along, across)]
    i, j = (index.reshape(-1, 1) for index in np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"))
    steps = ((0, 0), (1, 0), (1, 1), (0, 1))
    return np.stack([origin + (i + s) / counts[0] * along + (j + t) / counts[1] * across for s, t in steps], axis=1)


def _paint(squares: Float[np.ndarray, "n 4 3"]) -> Float[np.ndarray, "n 3"]:
    """Return the colour (0 to 255) of each square before shading."""
    middle = squares.mean(axis=1)
    normal = np.cross(squares[:, 1] - squares[:, 0], squares[:, 3] - squares[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    half = np.abs(middle[:, :2]).max(axis=0)
    on_ground = np.column_stack([*(30 + 200 * (middle[:, :2] / half + 1).T / 2), np.full(len(middle), 70.0)])
    lies, high = np.abs(normal[:, 2]) > _UP, middle[:, 2] > 0
    walls = np.where(normal[:, 1:2] < -_UP, _SOUTH, np.where(normal[:, 1:2] > _UP, _NORTH, _SIDE))
    return np.where(lies[:, None], np.where(high[:, None], _ROOF, on_ground), walls)
