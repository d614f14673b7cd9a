"""A level square of ground with a block on it, and straight-down photographs of it."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np

from aug3d_core.advice.choice import pose
from aug3d_core.advice.site import Site, site_of
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.views import Points, Views

HIGH_M, ROOF_M, HALF_M, FOCAL_PX, SIZE_PX = 60.0, 9.0, 120.0, 500.0, (640, 480)
PICTURE_M = HIGH_M * 480 / FOCAL_PX
ORIGIN = {"lat_deg": 46.9, "lon_deg": 7.5, "alt_m": 540.0}


def mesh(roof_m: float = ROOF_M, hole: bool = False) -> Mesh:
    """Return ground of squares of 10 m, with a block of 20 m about (40, 40); hole: nothing about the middle."""
    side = np.arange(-HALF_M, HALF_M, 10.0)
    squares = [(x, y, 0.0) for x in side for y in side if not (hole and abs(x + 5) < 30 and abs(y + 5) < 30)]
    squares += [(x, y, roof_m) for x in (30.0, 40.0) for y in (30.0, 40.0)]
    corners = np.array([(0, 0, 0), (10, 0, 0), (10, 10, 0), (0, 10, 0)], float)
    xyz = np.concatenate([np.array(square) + corners for square in squares])
    triangles = np.concatenate([np.array([(0, 1, 2), (0, 2, 3)]) + 4 * i for i in range(len(squares))])
    return Mesh(xyz.astype(np.float32), np.full((len(xyz), 3), 120, np.uint8), triangles.astype(np.int32))


def views(skipped_m: float = 0.0) -> Views:
    """Return photographs on a grid 15 m apart that look straight down; none within `skipped_m` of the middle, along x and y."""
    side = np.arange(-75.0, 76.0, 15.0)
    places = [(x, y, HIGH_M) for y in side for x in side if max(abs(x), abs(y)) >= skipped_m]
    n = len(places)
    poses = np.stack([pose(np.array(place), 0.0, -90.0) for place in places])
    intrinsics = np.array([FOCAL_PX, FOCAL_PX, SIZE_PX[0] / 2, SIZE_PX[1] / 2])
    return Views(np.arange(n), poses, np.tile(intrinsics, (n, 1)), np.tile(SIZE_PX, (n, 1)))


def ground_points() -> np.ndarray:
    xy = np.random.default_rng(0).uniform(-HALF_M, HALF_M, (4000, 2))
    return np.column_stack([xy, np.zeros(len(xy))])


@cache
def site(skipped_m: float = 0.0, roof_m: float = ROOF_M, hole: bool = False, margin: float | None = 15.0) -> Site:
    return site_of(mesh(roof_m, hole), views(skipped_m), ground_points(), margin)


def write_scene(folder: Path, skipped_m: float = 0.0, hole: bool = False, gps: bool = True) -> tuple[Path, Path]:
    """Write what the advice reads of a finished scene: the folders of sfm and surface."""
    sfm, surface = folder / "sfm", folder / "surface"
    sfm.mkdir(parents=True)
    surface.mkdir()
    views(skipped_m).save(sfm / "views.npz")
    xyz = ground_points()
    Points(xyz, np.zeros((len(xyz), 3), np.uint8), np.zeros(len(xyz))).save(sfm / "points.npz")
    world = {"metric": gps, "unit": "m" if gps else "unit", "origin": ORIGIN if gps else None}
    (sfm / "world.json").write_text(json.dumps(world))
    mesh(hole=hole).save(surface / "baseline_mesh.ply")
    return sfm, surface
