"""Exact cameras, brought into the world by GPS that is not: cells that need no stage of the factory.

The state is what the sfm stage would report, which takes the world from the same functions.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from aug3d_core.geometry.similarity import Similarity
from aug3d_core.geometry.transforms import centres
from aug3d_core.run.stage import Metric, Outcome
from aug3d_core.sfm.align import align
from aug3d_core.sfm.doming import measure_doming
from aug3d_core.studies.stability.positions_off import scattered, thrown
from aug3d_core.town.config import TownConfig
from aug3d_core.town.drone.flight import plan_flight

_TOWN = TownConfig(length_m=120, width_m=90, altitude_m=45)
_GROUND_POINTS = 3000
_HOUSES, _HOUSE_M = 0.2, 8.0  # share of the points on roofs, and their height
_PICTURE = "world.png"

Measure = Float[np.ndarray, "n 3"]


def noisy(dose: float, method: str, seed: int, out: Path) -> Outcome:
    """Measure positions with so many metres of noise."""
    rng = np.random.default_rng(seed)
    views = plan_flight(_TOWN, rng)
    return _place(views.cam_from_world, scattered(centres(views.cam_from_world), dose, rng), rng, out)


def wild(dose: float, method: str, seed: int, out: Path) -> Outcome:
    """Measure positions of which this share is 100 m off."""
    rng = np.random.default_rng(seed)
    views = plan_flight(_TOWN, rng)
    return _place(views.cam_from_world, thrown(centres(views.cam_from_world), dose, rng), rng, out)


def _place(
    cam_from_world: Float[np.ndarray, "n 3 4"], measured_m: Measure, rng: np.random.Generator, out: Path
) -> Outcome:
    points = _ground(rng)
    into_model = Similarity(0.1, _turned(rng), np.array([3.0, -2.0, 1.0]))  # as structure from motion would: any frame
    alignment = align(
        into_model.move_cameras(cam_from_world), into_model.apply(points), 5.0, measured_m, np.random.default_rng(0)
    )
    true_m = centres(cam_from_world)
    placed = alignment.world_from_model.apply(into_model.apply(true_m))
    doming = measure_doming(placed, measured_m) if alignment.metric else None
    notes = (*((alignment.problem,) if alignment.problem else ()), *(doming.notes if doming else ()))
    metrics: dict[str, Metric] = {"metric": alignment.metric}
    if alignment.metric:
        metrics["world_error_pct"] = world_error_pct(placed, true_m)
        metrics["scale"] = alignment.world_from_model.scale * into_model.scale
    _draw(true_m, measured_m, placed if alignment.metric else None, out / _PICTURE)
    state = "degraded" if alignment.problem or (doming and doming.flagged) else "ok"
    return Outcome(metrics=metrics, state=state, notes=notes, pictures={"From above: true, measured, placed": _PICTURE})


def world_error_pct(placed_m: Measure, true_m: Measure) -> float:
    """Return how far cameras are off at most, in percent of the flight's extent; a shift of all alike is no error."""
    off_m = (placed_m - placed_m.mean(axis=0)) - (true_m - true_m.mean(axis=0))
    return float(100 * np.linalg.norm(off_m, axis=1).max() / np.linalg.norm(np.ptp(true_m, axis=0)))


def _ground(rng: np.random.Generator) -> Measure:
    xy = rng.uniform(-0.6, 0.6, (_GROUND_POINTS, 2)) * (_TOWN.length_m, _TOWN.width_m)
    return np.column_stack([xy, _HOUSE_M * (rng.random(_GROUND_POINTS) < _HOUSES)])


def _turned(rng: np.random.Generator) -> Float[np.ndarray, "3 3"]:
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return q * np.sign(np.linalg.det(q))


def _draw(true_m: Measure, measured_m: Measure, placed_m: Measure | None, path: Path) -> None:
    figure = Figure(figsize=(5, 4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for true, measured in zip(true_m, measured_m, strict=True):
        axes.plot(*np.stack([true, measured])[:, :2].T, color="#94a3b8", lw=0.6, zorder=1)
    axes.scatter(*measured_m[:, :2].T, s=14, color="#dc2626", label="GPS", zorder=2)
    axes.scatter(*true_m[:, :2].T, s=26, facecolor="none", edgecolor="#15803d", label="true", zorder=3)
    if placed_m is not None:
        axes.scatter(*placed_m[:, :2].T, s=12, marker="x", color="#1d4ed8", label="placed", zorder=4)
    axes.set(aspect="equal", xlabel="east (m)", ylabel="north (m)")
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=90, metadata={"Software": None})
