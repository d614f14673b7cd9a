"""Trees, bushes and hedges: a core with many small leaf cards about it, so that the outline is as ragged as leaves."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from aug3d_core.town.generator.model import Frame, Model
from aug3d_core.town.generator.plan import Rect, Tree
from aug3d_core.town.generator.swatches import Swatches

_CORE_RINGS, _CORE_SIDES = 5, 8


def add_tree(model: Model, swatches: Swatches, tree: Tree, rng: np.random.Generator) -> None:
    """Append a trunk and a crown."""
    family = swatches.needles if tree.kind == "cone" else swatches.leaves
    patch = int(family[rng.integers(len(family))])
    bottom = 0.0 if tree.kind == "bush" else tree.height_m * (0.12 if tree.kind == "cone" else 0.28)
    half = (tree.height_m - bottom) / 2
    centre = np.array([tree.x, tree.y, bottom + half])
    radii = np.array([tree.radius_m, tree.radius_m, half])
    if tree.kind != "bush":
        w = 0.06 * tree.radius_m + 0.06
        model.box(
            Frame(tree.x, tree.y, 0.0), (-w, -w, -0.6), (w, w, bottom + half), swatches.bark, swatches.bark, taper=w / 3
        )
    lumps = _Lumps(rng)
    _core(model, centre, radii, tree.kind, lumps, patch)
    _leaves(model, centre, radii, tree.kind, lumps, patch, rng)


class _Lumps:
    """A smooth bumpy function on the sphere: crowns are not balls."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.axes = rng.normal(size=(7, 3))
        self.axes /= np.linalg.norm(self.axes, axis=1, keepdims=True)
        self.heights = rng.uniform(0.1, 0.34, 7)

    def __call__(self, direction: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
        near = np.exp(-9.0 * (1.0 - direction @ self.axes.T))
        return 0.82 + near @ self.heights


def _shape(direction: Float[np.ndarray, "n 3"], kind: str, lumps: _Lumps) -> Float[np.ndarray, "n 3"]:
    """Return points of the unit crown's skin."""
    if kind == "cone":
        up = direction[:, 2:]
        return np.concatenate([direction[:, :2] * (1.05 - up) / 1.6, up], axis=1)
    return direction * lumps(direction)[:, None]


def _core(model: Model, centre: np.ndarray, radii: np.ndarray, kind: str, lumps: _Lumps, patch: int) -> None:
    polar = np.linspace(0, np.pi, _CORE_RINGS + 1)
    turn = np.linspace(0, 2 * np.pi, _CORE_SIDES, endpoint=False)
    p, t = (a.ravel() for a in np.meshgrid(polar, turn, indexing="ij"))
    ball = np.stack([np.sin(p) * np.cos(t), np.sin(p) * np.sin(t), np.cos(p)], axis=1)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(_CORE_RINGS), np.arange(_CORE_SIDES), indexing="ij"))
    a, b = i * _CORE_SIDES + j, i * _CORE_SIDES + (j + 1) % _CORE_SIDES
    triangles = np.concatenate(
        [np.stack([a, a + _CORE_SIDES, b + _CORE_SIDES], 1), np.stack([a, b + _CORE_SIDES, b], 1)]
    )
    uv = np.stack([p / np.pi, t / (2 * np.pi)], axis=1)
    model.add(centre + 0.82 * radii * _shape(ball, kind, lumps), triangles, patch, uv[triangles])


def _leaves(
    model: Model, centre: np.ndarray, radii: np.ndarray, kind: str, lumps: _Lumps, patch: int, rng: np.random.Generator
) -> None:
    count = int(np.clip(90 * radii[0] * (radii[0] + radii[2]) / 2, 60, 750))
    direction = rng.normal(size=(count, 3))
    direction[:, 2] = np.where(rng.random(count) < 0.6, np.abs(direction[:, 2]), direction[:, 2])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    depth = rng.uniform(0.80, 1.06, (count, 1))
    at = centre + radii * _shape(direction, kind, lumps) * depth
    normal = direction + 0.9 * rng.normal(size=(count, 3))
    side = np.cross(normal, rng.normal(size=(count, 3)))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(normal, side)
    other /= np.linalg.norm(other, axis=1, keepdims=True)
    size = rng.uniform(0.12, 0.28, (count, 1)) * (0.7 + 0.12 * radii[0])
    square = np.array([(-1, -0.7), (1, -1), (0.8, 1), (-1, 0.8)])
    vertices = (
        at[:, None] + square[None, :, :1] * (side * size)[:, None] + square[None, :, 1:] * (other * size)[:, None]
    )
    square_of = 4 * np.arange(count)[:, None]
    triangles = np.concatenate([square_of + np.array(corners) for corners in ((0, 1, 2), (0, 2, 3))])
    spot = rng.uniform(0.1, 0.9, (count, 1, 2)) + 0.09 * square[None]
    corner = np.concatenate([spot[:, [0, 1, 2]], spot[:, [0, 2, 3]]])
    model.add(vertices.reshape(-1, 3), triangles, patch, corner)


def add_hedge(model: Model, swatches: Swatches, hedge: Rect, rng: np.random.Generator) -> None:
    """Append a hedge as a row of clipped bushes."""
    long_x = hedge.x1 - hedge.x0 > hedge.y1 - hedge.y0
    length, width = sorted((hedge.x1 - hedge.x0, hedge.y1 - hedge.y0))[::-1]
    x, y = (hedge.x0 + hedge.x1) / 2, (hedge.y0 + hedge.y1) / 2
    frame = Frame(x, y, 0.0 if long_x else np.pi / 2)
    high, patch = rng.uniform(1.0, 1.9), int(swatches.leaves[rng.integers(len(swatches.leaves))])
    step = 0.8 if length < 40 else 1.6  # the long ones are far out in the country
    for start in np.arange(-length / 2, length / 2 - 0.2, step):
        half = width / 2 * rng.uniform(0.8, 1.15)
        top = high * rng.uniform(0.88, 1.1)
        model.box(frame, (start, -half, -0.5), (start + step + 0.05, half, top), patch, patch, taper=0.08)
