"""Fusion of many depth maps tile by tile of ground, so that memory depends on a tile and not on the scene.

A tile is fused from what its photographs' maps show of it and of a margin around it: the maps are cut to that, each to a
camera of its own, so that what is read and held is the tile's too. COLMAP's own bounding box would read whole maps for every
tile they reach into. Of the points, those over the tile are kept; a margin's are its neighbour's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from PIL import Image

from aug3d_core.depth.cameras import Camera, camera_of
from aug3d_core.depth.files import FUSED_TILES, WORKSPACE_DEPTH_MAPS, WORKSPACE_NORMAL_MAPS, geometric_map_name
from aug3d_core.depth.fusion import fuse
from aug3d_core.depth.workspace import IMAGES, SPARSE, sparse_model
from aug3d_core.geometry.depth_maps import read_map, write_map
from aug3d_core.geometry.ground_tiles import Halved, Planned, Tile, halve, leaves
from aug3d_core.geometry.stored_points import StoredPoints, join_points
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.photos.files import image_name
from aug3d_core.run.atomic_file import replacing
from aug3d_core.run.scratch import scratch_folder

MOST_PIXELS = 25_000_000
# Around a tile, in depths. A point is made of pixels within 1 % of its depth and 1.5 px, some 0.01 depths on the ground; what
# those pixels could have joined instead lies as far away again, and so on, ever less often
MARGIN_DEPTHS = 0.05
FAR_PCT = 95  # of the sparse points' depths: the ground at an oblique view's horizon does not set the margin
SAMPLE = 200_000  # pixels that tell where to halve the ground


@dataclass(frozen=True)
class Dense:
    """Depth and normal maps in a workspace of COLMAP's, with the images, and what they were made with."""

    workspace: Path
    views: Views
    sizes: Int[np.ndarray, "n 2"]  # width, height of the maps
    points: Points
    tracks: Tracks

    def camera(self, view: int) -> Camera:
        """Return the camera of a view's maps."""
        return camera_of(self.views, view, self.sizes[view])

    def map_path(self, kind: str, view: int) -> Path:
        """Return the file of a view's depth or normal map."""
        return self.workspace / kind / geometric_map_name(int(self.views.photo_id[view]))


@dataclass(frozen=True)
class FusionPlan:
    """The tiles, the margin around them (world units), and the ground that each chosen view's depth map reaches.

    Ground is told in squares as wide as the margin, by the whole numbers of their lower corners.
    """

    tiles: Halved | Planned
    margin: float
    squares: dict[int, Int[np.ndarray, "s 2"]]

    def reaching(self, around: Tile) -> list[int]:
        """Return the views whose maps show some of a tile."""
        return [
            view
            for view, squares in self.squares.items()
            if ((squares * self.margin < around.high) & ((squares + 1) * self.margin > around.low)).all(axis=1).any()
        ]


def fuse_to(
    path: Path,
    dense: Dense,
    chosen: list[int],
    told: Callable[[int, int], None] = lambda done, tiles: None,
    most: int = MOST_PIXELS,
) -> tuple[int, int]:
    """Fuse the maps of the chosen views and write the points; return how many there are, and the tiles it took.

    Maps of more than `most` pixels are fused in tiles of about so many, and the points are in the order of the tiles. What a
    killed try has left of them in `FUSED_TILES` beside `path` is not made again; the caller removes that.
    told: called with the number of tiles that are fused, and of all.
    """
    if dense.sizes[chosen].prod(axis=1).sum() <= most:
        fused = fuse(dense.workspace, dense.views, chosen)
        fused.save(path)
        return len(fused.xyz), 1
    plan = plan_fusion(dense, chosen, most)
    tiles, folder = [*leaves(plan.tiles)], path.parent / FUSED_TILES / path.stem
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{number:05}.npz" for number in range(len(tiles))]
    for done, (tile, file) in enumerate(zip(tiles, files, strict=True)):
        told(done, len(tiles))
        if not file.exists():
            _fuse_tile(dense, plan, tile.ground, file)
    parts = [StoredPoints.open(file) for file in files]
    join_points(parts, path)
    return sum(len(part) for part in parts), len(tiles)


def plan_fusion(dense: Dense, chosen: list[int], most: int) -> FusionPlan:
    """Read each depth map once and plan tiles of about `most` pixels with a depth at most."""
    margin = MARGIN_DEPTHS * _far(dense, chosen)
    step = -(-int(dense.sizes[chosen].prod(axis=1).sum()) // SAMPLE)
    sample, squares, first = [np.zeros((0, 2))], {}, 0
    for view in sorted(chosen):
        xy = _world_of(read_map(dense.map_path(WORKSPACE_DEPTH_MAPS, view)), dense.camera(view))[2][:, :2]
        sample.append(xy[-first % step :: step].copy())  # else all pixels would stay
        first += len(xy)
        squares[view] = _unique(np.floor(xy / margin).astype(np.int64))
    return FusionPlan(halve(np.concatenate(sample), step, most), margin, squares)


def _unique(squares: Int[np.ndarray, "p 2"]) -> Int[np.ndarray, "s 2"]:
    """Return each square once; NumPy's own way for rows takes forty times as long."""
    change = (
        np.flatnonzero((np.diff(squares, axis=0) != 0).any(axis=1)) + 1
    )  # a map's pixels are in the order of its rows
    return np.unique(squares[np.concatenate([[0], change])[: len(squares)]], axis=0)


def _far(dense: Dense, chosen: list[int]) -> float:
    seen = np.isin(dense.tracks.view, chosen)
    pose = dense.views.cam_from_world[dense.tracks.view[seen], 2]
    depth = (pose[:, :3] * dense.points.xyz[dense.tracks.point[seen]]).sum(axis=1) + pose[:, 3]
    return float(np.percentile(depth[depth > 0], FAR_PCT))


def _world_of(
    depth: Float[np.ndarray, "h w"], camera: Camera
) -> tuple[np.ndarray, np.ndarray, Float[np.ndarray, "p 3"]]:
    """Return row, column and place in the world of each pixel that has a depth."""
    row, column = np.nonzero(depth > 0)
    in_cam = camera.rays[row, column] * depth[row, column][:, None]
    return row, column, (in_cam - camera.cam_from_world[:, 3]) @ camera.cam_from_world[:, :3]


def _fuse_tile(dense: Dense, plan: FusionPlan, ground: Tile, file: Path) -> None:
    """Write the points over a tile; the file is there whole, or not at all."""
    around = ground.grown(plan.margin)
    with scratch_folder(file.with_suffix("")) as folder:
        for part in (IMAGES, SPARSE, WORKSPACE_DEPTH_MAPS, WORKSPACE_NORMAL_MAPS):
            (folder / part).mkdir(parents=True)
        windows = {view: window for view in plan.reaching(around) if (window := _cut(dense, view, around, folder))}
        views, tracks = _cut_views(dense, windows)
        every = [*range(len(views))]
        sparse_model(views, views.size, dense.points, tracks, every).write(folder / SPARSE)
        fused = fuse(folder, views, every)
    with replacing(file, file.with_name(f".{file.name}")) as opened:
        fused.take(ground.holds(fused.xyz)).write(opened)


def _cut(dense: Dense, view: int, around: Tile, folder: Path) -> tuple[int, int, int, int] | None:
    """Write what a view's maps show of a tile; return left, top, right, bottom of that in the maps, None if it is nothing."""
    depth = read_map(dense.map_path(WORKSPACE_DEPTH_MAPS, view))
    row, column, xyz = _world_of(depth, dense.camera(view))
    inside = around.holds(xyz)
    if not inside.any():
        return None
    row, column = row[inside], column[inside]
    shown = np.zeros_like(depth)
    shown[row, column] = depth[row, column]
    left, top, right, bottom = int(column.min()), int(row.min()), int(column.max()) + 1, int(row.max()) + 1
    normals = read_map(dense.map_path(WORKSPACE_NORMAL_MAPS, view))
    photo_id = int(dense.views.photo_id[view])
    name, map_name = image_name(photo_id), geometric_map_name(photo_id)
    write_map(folder / WORKSPACE_DEPTH_MAPS / map_name, shown[top:bottom, left:right])
    write_map(folder / WORKSPACE_NORMAL_MAPS / map_name, normals[top:bottom, left:right])
    with Image.open(dense.workspace / IMAGES / name) as image:
        image.crop((left, top, right, bottom)).save(folder / IMAGES / name, compress_level=1)
    return left, top, right, bottom


def _cut_views(dense: Dense, windows: dict[int, tuple[int, int, int, int]]) -> tuple[Views, Tracks]:
    """Return the views that see the windows of their maps alone, and their tracks, also of points beside the windows.

    Those too tell which photographs overlap.
    """
    chosen = np.array([*windows], int)
    corners = np.array([*windows.values()], int).reshape(-1, 4)
    cameras = [dense.camera(int(view)) for view in chosen]
    intrinsics = np.array([camera.intrinsics for camera in cameras]).reshape(-1, 4)
    intrinsics[:, 2:] -= corners[:, :2]
    views = Views(
        dense.views.photo_id[chosen], dense.views.cam_from_world[chosen], intrinsics, corners[:, 2:] - corners[:, :2]
    )
    kept = np.isin(dense.tracks.view, chosen)
    view = np.searchsorted(chosen, dense.tracks.view[kept])
    scale = (dense.sizes / dense.views.size)[chosen]
    xy = dense.tracks.xy[kept] * scale[view] - corners[view, :2]
    return views, Tracks(dense.tracks.point[kept], view, xy)
