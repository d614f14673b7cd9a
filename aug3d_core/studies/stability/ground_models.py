"""Models of the ground on land that is known exactly, with houses on it: cells that need no stage of the factory.

The factory takes the simplest kind of ground that foretells the points, and says so where the land is rougher: when it
looks for buildings. A level and a plane stand beside it to compare.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from aug3d_core.domes.orthographic import ground_doubts
from aug3d_core.geometry.ground_model import fit_ground
from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.up_direction import fit_up, ground_height, up_from_cameras
from aug3d_core.run.stage import Outcome
from aug3d_core.town.generator.terrain import Terrain

_HALF_M = 80.0  # of the land, from its middle
_POINTS = 6000
_HOUSES_APART_M, _HOUSE_M, _HIGH_M = 32.0, 14.0, 8.0
_FALSE_SHARE, _FALSE_M = 0.01, 15.0  # false points, and how far off their heights are
_NOISE_M = 0.1
_SMALLEST_M = 4.75  # building that is looked for from 45 m: a twelfth of what a view shows
_THICKNESS_M = 1.0
_PICTURE = "ground.png"
LEVEL, PLANE, CHOSEN = "level", "tilted plane", "chosen"

Heights = Callable[[Float[np.ndarray, "n 2"]], Float[np.ndarray, " n"]]


def slope(dose: float, method: str, seed: int, out: Path) -> Outcome:
    """Lay the houses on a plane that rises by so many degrees."""
    return _model(Terrain("slope", dose), method, seed, out)


def terraces(dose: float, method: str, seed: int, out: Path) -> Outcome:
    """Lay the houses on steps of 30 m that rise by so many degrees in the mean."""
    return _model(Terrain("terraces", dose), method, seed, out)


def _model(terrain: Terrain, method: str, seed: int, out: Path) -> Outcome:
    points = _points(terrain, np.random.default_rng(seed))
    fits = {LEVEL: _level, PLANE: _plane, CHOSEN: _chosen}
    height = fits[method](points)
    axis = np.linspace(-_HALF_M, _HALF_M, 41)[1:-1]
    places = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    off_m = np.abs(height(places) - terrain.height(*places.T))
    _draw(points, terrain, height, out / _PICTURE)
    doubts = ground_doubts(fit_ground(points, np.random.default_rng(0)), _SMALLEST_M)
    return Outcome(
        metrics={"ground_error_m": float(np.percentile(off_m, 90))},
        state="degraded" if doubts else "ok",
        notes=doubts,
        pictures={"Points, true ground, and the model, from the west": _PICTURE},
    )


def _level(points: Float[np.ndarray, "p 3"]) -> Heights:
    level = ground_height(points[:, 2])
    return lambda xy: np.full(len(xy), level)


def _plane(points: Float[np.ndarray, "p 3"]) -> Heights:
    flown = [look_at(np.array([0.0, 0.0, 50.0]), np.array([0.0, way, 0.0])) for way in (-1.0, 1.0)]  # to and fro
    up = fit_up(points, up_from_cameras(np.stack(flown)), _THICKNESS_M, np.random.default_rng(0))
    offset = ground_height(points @ up)
    return lambda xy: (offset - xy @ up[:2]) / up[2]


def _chosen(points: Float[np.ndarray, "p 3"]) -> Heights:
    return fit_ground(points, np.random.default_rng(0)).height_at


def _points(terrain: Terrain, rng: np.random.Generator) -> Float[np.ndarray, "p 3"]:
    """Return what a flight would find of houses in rows, each on its own level, with noise and a few false points."""
    xy = rng.uniform(-_HALF_M, _HALF_M, (_POINTS, 2))
    middle = (np.floor(xy / _HOUSES_APART_M) + 0.5) * _HOUSES_APART_M
    roof = (np.abs(xy - middle) < _HOUSE_M / 2).all(axis=1)
    z = np.where(roof, terrain.height(*middle.T) + _HIGH_M, terrain.height(*xy.T)) + rng.normal(0, _NOISE_M, _POINTS)
    false = rng.random(_POINTS) < _FALSE_SHARE
    return np.column_stack([xy, z + false * rng.normal(0, _FALSE_M, _POINTS)])


def _draw(points: Float[np.ndarray, "p 3"], terrain: Terrain, height: Heights, path: Path) -> None:
    figure = Figure(figsize=(6, 3), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    near = points[np.abs(points[:, 0]) < 10]
    axes.scatter(near[:, 1], near[:, 2], s=2, color="#94a3b8", label="points")
    line = np.column_stack([np.zeros(200), np.linspace(-_HALF_M, _HALF_M, 200)])
    axes.plot(line[:, 1], terrain.height(*line.T), color="#15803d", lw=2, label="true ground")
    axes.plot(line[:, 1], height(line), color="#dc2626", lw=1.5, ls="--", label="model")
    axes.set(xlabel="north (m)", ylabel="height (m)")
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=90, metadata={"Software": None})
