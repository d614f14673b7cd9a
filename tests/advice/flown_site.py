"""A level square of ground with a block on it, and straight-down photographs of it."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np

from aug3d_core.advice.choice import pose
from aug3d_core.advice.site import Site, site_of
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import centres
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


def with_piece(whole: Mesh, xyz: np.ndarray, triangles: np.ndarray) -> Mesh:
    """Return a mesh with another piece beside it."""
    return Mesh(
        np.concatenate([whole.xyz, xyz.astype(np.float32)]),
        np.concatenate([whole.rgb, np.full((len(xyz), 3), 120, np.uint8)]),
        np.concatenate([whole.triangles, (triangles + len(whole.xyz)).astype(np.int32)]),
    )


def tower(wide_m: float, low_m: float, high_m: float) -> Mesh:
    """Return the mesh with a tower beside the block, from 20 m east and north; low_m: of its foot."""
    side = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * wide_m + 20.0
    xyz = np.concatenate([np.column_stack([side, np.full(4, height)]) for height in (low_m, high_m)])
    walls = [((i, j, j + 4), (i, j + 4, i + 4)) for i, j in ((0, 1), (1, 2), (2, 3), (3, 0))]
    return with_piece(mesh(), xyz, np.concatenate([*walls, [(4, 5, 6), (4, 6, 7)]]))


def orbit(tilt_deg: float, focal_px: float) -> Views:
    """Return photographs from all round that look at the middle."""
    turns = np.arange(0.0, 360.0, 9.0)
    away = HIGH_M * np.tan(np.radians(tilt_deg))
    places = [(-away * np.sin(turn), -away * np.cos(turn), HIGH_M) for turn in np.radians(turns)]
    poses = np.stack([pose(np.array(at), yaw, tilt_deg - 90) for at, yaw in zip(places, turns, strict=True)])
    intrinsics = np.array([focal_px, focal_px, SIZE_PX[0] / 2, SIZE_PX[1] / 2])
    return Views(np.arange(len(poses)), poses, np.tile(intrinsics, (len(poses), 1)), np.tile(SIZE_PX, (len(poses), 1)))


def on_slope(rise: float, roof_m: float = 0.0) -> tuple[Mesh, Views, np.ndarray]:
    """Return mesh, photographs and points of the site, tilted: so many metres up for each to the east."""

    def lifted(xyz: np.ndarray) -> np.ndarray:
        return xyz + rise * xyz[..., :1] * np.array([0.0, 0.0, 1.0])

    flat, flown = mesh(roof_m), views()
    poses = np.stack([pose(at, 0.0, -90.0) for at in lifted(centres(flown.cam_from_world))])
    return (
        Mesh(lifted(flat.xyz).astype(np.float32), flat.rgb, flat.triangles),
        Views(flown.photo_id, poses, flown.intrinsics, flown.size),
        lifted(ground_points()),
    )


def ground_points() -> np.ndarray:
    xy = np.random.default_rng(0).uniform(-HALF_M, HALF_M, (4000, 2))
    return np.column_stack([xy, np.zeros(len(xy))])


@cache
def site(skipped_m: float = 0.0, roof_m: float = ROOF_M, hole: bool = False, margin: float | None = 15.0) -> Site:
    return site_of(mesh(roof_m, hole), views(skipped_m), ground_points(), margin)


def write_scene(
    folder: Path, skipped_m: float = 0.0, hole: bool = False, gps: bool = True, roof_m: float = ROOF_M
) -> tuple[Path, Path]:
    """Write what the advice reads of a finished scene: the folders of sfm and surface."""
    sfm, surface = folder / "sfm", folder / "surface"
    sfm.mkdir(parents=True)
    surface.mkdir()
    views(skipped_m).save(sfm / "views.npz")
    xyz = ground_points()
    Points(xyz, np.zeros((len(xyz), 3), np.uint8), np.zeros(len(xyz))).save(sfm / "points.npz")
    world = {"metric": gps, "unit": "m" if gps else "unit", "origin": ORIGIN if gps else None}
    (sfm / "world.json").write_text(json.dumps(world))
    mesh(roof_m, hole).save(surface / "baseline_mesh.ply")
    return sfm, surface
