"""Group views by where the cameras stand: cells on the ground plane, and the K cameras nearest to the centre of each.

The paper's second way: alone, and with its constraint that the cameras of a group look in roughly the same direction.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.geometry.transforms import centres, forward
from aug3d_core.groups.config import GroupingConfig
from aug3d_core.groups.scene import GroupingScene


def group(
    scene: GroupingScene,
    candidates: Int[np.ndarray, " m"],
    k: int,
    count: int,
    config: GroupingConfig,
    rng: np.random.Generator,
) -> Int[np.ndarray, "c k"]:
    """Return the K cameras nearest to each cell centre among those that look as the nearest does.

    Where fewer than K do, those that turn away least fill the group. Nothing is random here.
    """
    return _group(scene, candidates, k, count, config.grid_angle_deg)


def group_any_angle(
    scene: GroupingScene,
    candidates: Int[np.ndarray, " m"],
    k: int,
    count: int,
    config: GroupingConfig,
    rng: np.random.Generator,
) -> Int[np.ndarray, "c k"]:
    """Return the K cameras nearest to each cell centre, wherever they look. Nothing is set or random here."""
    return _group(scene, candidates, k, count, 180.0)


def cell_centres(positions: Float[np.ndarray, "n 2"], count: int) -> Float[np.ndarray, "c 2"]:
    """Return the centres of at most `count` square cells over the positions, those that hold none left out."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    cells, side = np.array([1, 1]), float((high - low).max())
    for across in range(1, count + 1):
        finer = np.maximum(1, np.ceil((high - low) * across / max(side, 1e-12) - 1e-9)).astype(int)
        if finer.prod() > count:
            break
        cells = finer
    step = max(side / cells.max(), 1e-12)
    corner = (low + high - cells * step) / 2
    place = np.floor((positions - corner) / step).astype(int).clip(0, cells - 1)
    return corner + (np.unique(place, axis=0) + 0.5) * step


def _group(
    scene: GroupingScene, candidates: Int[np.ndarray, " m"], k: int, count: int, most_angle_deg: float
) -> Int[np.ndarray, "c k"]:
    poses, photo_id = scene.views.cam_from_world[candidates], scene.views.photo_id[candidates]
    at, looks = centres(poses)[:, :2], forward(poses)
    rows: dict[frozenset[int], Int[np.ndarray, " k"]] = {}
    for cell in cell_centres(at, min(count, len(candidates))):
        away = np.linalg.norm(at - cell, axis=1)
        nearest = np.lexsort((photo_id, away))[0]
        angle_deg = np.degrees(np.arccos((looks @ looks[nearest]).clip(-1, 1)))
        beyond = np.maximum(0.0, angle_deg - most_angle_deg)
        beyond[nearest] = -1.0
        order = np.lexsort((photo_id, away, beyond))[:k]
        rows.setdefault(frozenset(order.tolist()), order)
    return candidates[np.stack(list(rows.values()))]
