"""Damage to what structure from motion found: fewer points, or photographs that hardly see any."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Bool

from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.sfm.files import POINTS, TRACKS, VIEWS

_LEFT = 0.02  # of what an isolated photograph sees


def lose(folder: Path, dose: float, rng: np.random.Generator) -> None:
    """Keep this share of the points, with all that see them; every photograph keeps one at least."""
    tracks = Tracks.load(folder / TRACKS)
    points = Points.load(folder / POINTS)
    kept = rng.random(len(points.xyz)) < dose
    _keep(folder, kept[tracks.point], rng)


def isolate(folder: Path, dose: float, rng: np.random.Generator) -> None:
    """Let this share of the photographs see one in fifty of their points."""
    tracks, views = Tracks.load(folder / TRACKS), len(Views.load(folder / VIEWS))
    alone = rng.permutation(views) < round(dose * views)
    _keep(folder, ~alone[tracks.view] | (rng.random(len(tracks.view)) < _LEFT), rng)


def _keep(folder: Path, seen: Bool[np.ndarray, " t"], rng: np.random.Generator) -> None:
    """Write the observations that are left, and the points that two photographs or more still see."""
    tracks, points = Tracks.load(folder / TRACKS), Points.load(folder / POINTS)
    seen = seen & (np.bincount(tracks.point[seen], minlength=len(points.xyz)) >= 2)[tracks.point]
    left, number = np.unique(tracks.point[seen], return_inverse=True)
    Tracks(number.reshape(-1), tracks.view[seen], tracks.xy[seen]).save(folder / TRACKS)
    Points(points.xyz[left], points.rgb[left], points.error_px[left]).save(folder / POINTS)
