"""Damage to the fused points that meshes are drawn through: points in the air, holes, normals the wrong way round.

Both sets of points, with and without the photographs of the test block, are damaged in the same places.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial.transform import Rotation

from aug3d_core.depth.files import BASELINE_FUSED, FUSED
from aug3d_core.geometry.fused import Fused

_CLUMP = 200  # points that float together: twice what a loose piece of surface must carry
_CLUMP_SHARE = 0.03  # of the extent: radius of a clump
_HEIGHT_SHARE = 0.3  # of the extent: clumps float up to this high
_PATCH_SHARE = 0.06  # of the extent: radius of a hole, and of a patch of turned normals


def floaters(folder: Path, dose: float, rng: np.random.Generator) -> None:
    """Let points float over the surface in clumps, as many as this share of the true ones."""
    _damage(folder, lambda points, chance: _with_clumps(points, dose, chance), rng)


def holes(folder: Path, dose: float, rng: np.random.Generator) -> None:
    """Take the points out of round places, until this share of them is gone."""
    _damage(folder, lambda points, chance: _taken(points, ~_in_patches(points.xyz, dose, chance)), rng)


def flipped(folder: Path, dose: float, rng: np.random.Generator) -> None:
    """Turn the normals round in round places, until this share of them is turned."""

    def turn(points: Fused, chance: np.random.Generator) -> Fused:
        sign = np.where(_in_patches(points.xyz, dose, chance), -1, 1)
        return replace(points, normals=points.normals * sign[:, None].astype(points.normals.dtype))

    _damage(folder, turn, rng)


def _damage(folder: Path, change: Callable[[Fused, np.random.Generator], Fused], rng: np.random.Generator) -> None:
    seed = int(rng.integers(2**32))
    for name in (FUSED, BASELINE_FUSED):
        change(Fused.load(folder / name), np.random.default_rng(seed)).save(folder / name)


def _extent(xyz: Float[np.ndarray, "n 3"]) -> float:
    return float(np.ptp(np.quantile(xyz[:, :2], [0.01, 0.99], axis=0), axis=0).max())


def _in_patches(xyz: Float[np.ndarray, "n 3"], share: float, rng: np.random.Generator) -> Bool[np.ndarray, " n"]:
    """Tell which points lie in patches that together hold this share of them, give or take a patch."""
    inside, radius = np.zeros(len(xyz), bool), _PATCH_SHARE * _extent(xyz)
    low, high = np.quantile(xyz[:, :2], [0.0, 1.0], axis=0)
    while inside.mean() < share:
        inside |= np.linalg.norm(xyz[:, :2] - rng.uniform(low, high), axis=1) < radius
    return inside


def _with_clumps(points: Fused, share: float, rng: np.random.Generator) -> Fused:
    """Add flat clumps, each turned its own way and of the colour of some point."""
    extent, clumps = _extent(points.xyz), round(share * len(points.xyz) / _CLUMP)
    if not clumps:
        return points
    low, high = np.quantile(points.xyz, [0.02, 0.98], axis=0)
    middle = rng.uniform([*low[:2], high[2]], [*high[:2], high[2] + _HEIGHT_SHARE * extent], (clumps, 3))
    turn = Rotation.from_quat(rng.normal(size=(clumps, 4))).as_matrix()
    radius = _CLUMP_SHARE * extent * np.sqrt(rng.random((clumps, _CLUMP)))
    angle = rng.uniform(0, 2 * np.pi, (clumps, _CLUMP))
    flat = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros_like(radius)], axis=-1)
    normals = np.repeat(turn[:, :, 2] * np.where(turn[:, 2:, 2] < 0, -1, 1), _CLUMP, axis=0)  # towards the cameras
    like = np.repeat(rng.integers(len(points.xyz), size=clumps), _CLUMP)
    added = Fused(
        (middle[:, None] + flat @ turn.transpose(0, 2, 1)).reshape(-1, 3), normals, points.rgb[like], points.views[like]
    )
    return _joined(points, added)


def _joined(one: Fused, other: Fused) -> Fused:
    parts = {
        name: np.concatenate([getattr(one, name), getattr(other, name).astype(getattr(one, name).dtype)])
        for name in ("xyz", "normals", "rgb", "views")
    }
    return Fused(**parts)


def _taken(points: Fused, which: Bool[np.ndarray, " n"]) -> Fused:
    return Fused(points.xyz[which], points.normals[which], points.rgb[which], points.views[which])
