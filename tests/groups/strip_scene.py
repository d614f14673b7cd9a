"""A flight over a strip of ground whose visibility is known exactly: each view sees the points within its footprint."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from aug3d_core.geometry.shared_points import look_positions, shared_points, visibility
from aug3d_core.geometry.transforms import centres, look_at
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.groups.scene import GroupingScene
from aug3d_core.sfm.files import COMPONENTS, POINTS, TRACKS, VIEWS


def fly(views: int = 40, points: int = 3000, length_m: float = 400.0, seed: int = 0) -> tuple[Views, Points, Tracks]:
    """Return a nadir flight in two strips along x; a footprint is 80 m wide."""
    rng = np.random.default_rng(seed)
    ground = rng.uniform([0, -40], [length_m, 40], size=(points, 2))
    xyz = np.append(ground, np.zeros((points, 1)), axis=1)
    x = np.linspace(0, length_m, views // 2)
    at = np.concatenate([np.stack([x, np.full_like(x, -15)], 1), np.stack([x[::-1], np.full_like(x, 15)], 1)])
    poses = np.stack([look_at(np.append(a, 60.0), np.append(a, 0.0)) for a in at])
    seen = np.abs(at[:, None] - ground[None]).max(axis=2) < 40
    view, point = np.nonzero(seen)
    order = np.lexsort((view, point))
    count = len(at)
    return (
        Views(np.arange(count) * 3, poses, np.tile([90.0, 90.0, 60.0, 60.0], (count, 1)), np.full((count, 2), 120)),
        Points(xyz, np.zeros((points, 3), np.uint8), np.zeros(points)),
        Tracks(point[order], view[order], np.zeros((len(view), 2))),
    )


def part_of(flight: tuple[Views, Points, Tracks], kept: np.ndarray) -> tuple[Views, Points, Tracks]:
    """Return the flight with only these views, in this order, and photo ids that count them."""
    views, points, tracks = flight
    now = np.full(len(views), -1)
    now[kept] = np.arange(len(kept))
    there = now[tracks.view] >= 0
    return (
        Views(np.arange(len(kept)), views.cam_from_world[kept], views.intrinsics[kept], views.size[kept]),
        points,
        Tracks(tracks.point[there], now[tracks.view[there]], tracks.xy[there]),
    )


def write_sfm(folder: Path, flight: tuple[Views, Points, Tracks], photo_sha256: Sequence[str] | None = None) -> Path:
    """Write what grouping reads of structure from motion; return the folder. photo_sha256: by photo id; made up without."""
    folder.mkdir(parents=True, exist_ok=True)
    for part, name in zip(flight, (VIEWS, POINTS, TRACKS), strict=True):
        part.save(folder / name)
    known = photo_sha256 or [str(photo_id) for photo_id in range(flight[0].photo_id.max() + 1)]
    (folder / COMPONENTS).write_text(json.dumps({"photo_sha256": known}))
    return folder


def scene_of(views: Views, points: Points, tracks: Tracks) -> GroupingScene:
    """Return the scene with its similarity."""
    shared = shared_points(visibility(tracks, len(views), len(points.xyz)))
    look, seen = look_positions(tracks, points.xyz, len(views))
    look = np.where((seen > 0)[:, None], look, centres(views.cam_from_world)[:, :2])
    return GroupingScene(views, shared, look, points.xyz)
